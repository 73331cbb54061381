// SPDX-License-Identifier: Apache-2.0
// Questions to the server. A long answer says how far it is (202) until it is there.

const wait = (ms, signal) => new Promise((done, fail) => {
  const timer = setTimeout(done, ms);
  signal?.addEventListener("abort", () => { clearTimeout(timer); fail(new DOMException("gone", "AbortError")); });
});

export class Trouble extends Error {}

async function ask(path, query, { signal, progress } = {}) {
  const url = `/api/${path}?${new URLSearchParams(query)}`;
  for (let pause = 120; ; pause = Math.min(pause * 1.3, 700)) {
    let answer;
    try {
      answer = await fetch(url, { signal });
    } catch (error) {
      if (error.name === "AbortError") throw error;
      throw new Trouble("The workbench does not answer. Was it stopped in its terminal? Start `driveid workbench` again and open the address it prints.");
    }
    if (answer.status === 202) {
      const { done, what } = await answer.json();
      progress?.(done, what);
      await wait(pause, signal);
      continue;
    }
    if (answer.ok) return answer;
    const text = await answer.text();
    let message = text;
    try { message = JSON.parse(text).message; } catch { /* plain text */ }
    throw new Trouble(message || `The workbench answered ${answer.status}.`);
  }
}

export const blob = async (path, query, options) => (await ask(path, query, options)).blob();
export const json = async (path, query, options) => (await ask(path, query, options)).json();

/** {head, arrays}: a JSON head and typed arrays behind it. */
export function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const arrays = {};
  for (const { name, type, offset, count } of head.arrays) {
    const at = 4 + length + offset;
    arrays[name] = type === "f8" ? new Float64Array(buffer, at, count) : new Float32Array(buffer, at, count);
  }
  return { head, arrays };
}

export const binary = async (path, query, options) => unpack(await (await ask(path, query, options)).arrayBuffer());

export async function post(path, data) {
  const answer = await fetch(`/api/${path}`, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(data) });
  const body = await answer.json();
  if (!answer.ok) throw new Trouble(body.message);
  return body;
}
