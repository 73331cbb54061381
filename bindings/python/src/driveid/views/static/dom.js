// SPDX-License-Identifier: Apache-2.0
// Small helpers for elements.

/** el("button.primary", {onclick}, "text", child): an element; children that are strings become text. */
export function el(what, attributes = {}, ...children) {
  const [tag, ...classes] = what.split(".");
  const node = document.createElement(tag);
  if (classes.length) node.className = classes.join(" ");
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "html") node.innerHTML = value;
    else if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value === true) node.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) node.setAttribute(name, value);
  }
  node.append(...children.filter((c) => c !== null && c !== undefined && c !== false));
  return node;
}

export function toast(text) {
  const box = document.getElementById("toast");
  box.textContent = text;
  box.classList.add("show");
  clearTimeout(toast.timer);
  toast.timer = setTimeout(() => box.classList.remove("show"), 2600);
}

export function trouble(error) {
  return el("section.card.trouble", {}, el("h2", {}, "This did not work"), el("p", {}, error.message));
}

/** A line that says how far a long answer is. */
export function busy(words = "asking") {
  const fill = el("div.fill", { style: "width:4%" });
  const text = el("span", {}, `${words} …`);
  const box = el("div.busy", { role: "progressbar" }, text, el("div.track", {}, fill));
  box.progress = (done, what) => {
    text.textContent = `${words}: ${what} …`;
    fill.style.width = `${Math.max(4, 100 * done)}%`;
  };
  return box;
}

/** Run an async answer into a place: progress while it lasts, its trouble where it fails. */
export async function into(place, signal, words, work) {
  const line = busy(words);
  place.replaceChildren(line);
  try {
    const nodes = await work({ signal, progress: line.progress });
    if (!signal.aborted && nodes) place.replaceChildren(...[nodes].flat());
  } catch (error) {
    if (error.name !== "AbortError" && !signal.aborted) place.replaceChildren(trouble(error));
  }
}

export const colour = (name) => getComputedStyle(document.body).getPropertyValue(`--${name}`).trim();
