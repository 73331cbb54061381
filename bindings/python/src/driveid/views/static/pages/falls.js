// SPDX-License-Identifier: Apache-2.0
// Page 5: each added effect as a step; undo; parameters before and after; export.

import * as api from "../api.js";
import { el, into, toast } from "../dom.js";
import * as state from "../state.js";

export function mount(place, { project, signal }) {
  const base = { p: project.id, add: state.get("add") };
  const chain = state.list("add");
  const bar = el("div.row"), stairs = el("section.card"), parameters = el("section.card");
  place.replaceChildren(bar, stairs, parameters);
  const undo = el("button", { onclick: () => state.go({ add: chain.slice(0, -1).join(","), models: null }), disabled: !chain.length, title: "Take the last effect out (u)" }, "Undo");
  const improve = el("button", { title: "Explain, add and fit until only noise is left", onclick: () => into(walk, signal, "walking to the noise floor", async (o) => {
    const a = await api.json("improve", base, o);
    if (a.add.length > chain.length) state.go({ add: a.add.join(","), models: null });
    else toast("No effect was added: nothing lowers the held-out error.");
    return el("span");
  }) }, "Add all that is missing");
  const walk = el("div");
  const more = el("button.primary", { onclick: () => state.go({}, "missing") }, chain.length ? "What is still missing?" : "What is missing?");
  const exports = ["report.html", "model.toml", "driveidd.toml"].map((f, k) => el("button", { "data-export": f, onclick: () => download(f, base, signal) }, ["Report", "Model file", "Daemon configuration"][k]));
  bar.replaceChildren(more, improve, undo, walk, el("span.space"), el("span.soft", {}, "Export"), ...exports);
  into(stairs, signal, "comparing each step", async (options) => {
    const a = await api.json("falls", { ...base, kind: state.get("kind") }, options);
    parameters.innerHTML = `<h2>${chain.length ? "Parameters before and after" : "Parameters"}</h2>${a.parameters}`;
    const pick = el("select", { "aria-label": "which error", onchange: (e) => state.go({ kind: e.target.value }) }, ...a.kinds.map((k) => el("option", { value: k.name, selected: k.name === a.kind }, k.title)));
    const box = el("div", { html: a.staircase, "data-steps": a.steps.length });
    return [el("div.row", {}, el("h2", { style: "margin:0" }, "The error after each step"), el("span.space"), pick), box];
  });
  return { keys: (e) => e.key === "u" && !undo.disabled && undo.click(), destroy() {} };
}

async function download(file, base, signal) {
  toast(`preparing ${file} …`);
  try {
    const url = URL.createObjectURL(await api.blob(`export/${file}`, base, { signal }));
    el("a", { href: url, download: file }).click();
    setTimeout(() => URL.revokeObjectURL(url), 10000);
  } catch (error) {
    if (error.name !== "AbortError") toast(error.message);
  }
}
