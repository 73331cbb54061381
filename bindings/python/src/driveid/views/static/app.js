// SPDX-License-Identifier: Apache-2.0
// The shell: pages, model strip, keys, theme, dialogs. What is shown follows the address (state.js).

import * as api from "./api.js";
import { el, toast, trouble } from "./dom.js";
import * as compare from "./pages/compare.js";
import * as falls from "./pages/falls.js";
import * as live from "./pages/live.js";
import * as missing from "./pages/missing.js";
import * as where from "./pages/where.js";
import * as state from "./state.js";

const PAGES = [["live", "Live", live], ["compare", "Compare", compare], ["where", "Where it fails", where], ["missing", "What is missing", missing], ["falls", "The error falls", falls]];
const page = document.getElementById("page"), strip = document.getElementById("strip"), dialog = document.getElementById("dialog");
let current = null, abort = new AbortController();

function tabs() {
  const now = state.page();
  document.getElementById("tabs").replaceChildren(...PAGES.map(([key, title], k) => el("a", { href: state.link(key), "aria-current": key === now ? "page" : null, onclick: (e) => { if (!e.ctrlKey && !e.metaKey) { e.preventDefault(); state.go({}, key); } } }, el("b", {}, String(k + 1)), title)));
  document.title = `${PAGES.find(([k]) => k === now)?.[1] ?? ""} · driveid`;
}

function modelStrip(project) {
  const own = project.effects.map((e) => el("span.chip", {}, `+ ${e.title}`));
  const added = project.chain.map((e, k) => el("span.chip", { "data-added": e.name }, `+ ${e.title}`, k === project.chain.length - 1 ? el("a", { href: "#", title: "take it out (u)", "aria-label": `take ${e.title} out`, onclick: (x) => { x.preventDefault(); state.go({ add: state.list("add").slice(0, -1).join(","), models: null }); } }, "✕") : null));
  strip.replaceChildren(el("span.name", {}, project.name), el("span.chip", {}, project.structure), ...own, ...added);
}

async function render() {
  abort.abort();
  abort = new AbortController();
  const { signal } = abort;
  current?.destroy();
  current = null;
  tabs();
  const [key, , module] = PAGES.find(([k]) => k === state.page()) ?? PAGES[1];
  page.dataset.page = key;
  if (key === "live") {
    strip.replaceChildren();
    current = module.mount(page);
    return;
  }
  if (!state.get("p")) {
    const { projects } = await api.json("known", {}, { signal });
    if (projects.length) state.go({ p: projects[0].id });
    return;
  }
  page.replaceChildren();
  try {
    const project = await api.json("project", { p: state.get("p"), add: state.get("add") }, { signal, progress: (done, what) => page.replaceChildren(el("p.soft", {}, `reading the records: ${what} …`)) });
    if (signal.aborted) return;
    modelStrip(project);
    current = module.mount(page, { project, signal });
  } catch (error) {
    if (error.name === "AbortError") return;
    strip.replaceChildren();
    page.replaceChildren(trouble(error), el("div.row", {}, el("button.primary", { onclick: openDialog }, "Open a model and records")));
  }
}

// Dialogs ---------------------------------------------------------------------------------------------------------

const STRUCTURES = ["rigid_axis", "linear_axis", "two_mass_axis", "dc_circuit", "dc_drive", "pmsm_drive", "lti"];

async function openDialog() {
  const { projects } = await api.json("known", {});
  const field = (name, title, hint, tag = "textarea") => [el("label", { for: `f-${name}` }, title), tag === "select" ? el("select", { id: `f-${name}`, name }, ...STRUCTURES.map((s) => el("option", {}, s))) : el(tag, { id: `f-${name}`, name, placeholder: hint, spellcheck: "false" })];
  const error = el("p.error.full", { role: "alert" });
  const form = el("form", { method: "dialog", onsubmit: async (e) => {
    e.preventDefault();
    error.textContent = "";
    try {
      const { id } = await api.post("open", Object.fromEntries(new FormData(form)));
      dialog.close();
      history.pushState(null, "", `/compare?p=${id}`);
      render();
    } catch (problem) { error.textContent = problem.message; }
  } }, el("h2", {}, "Open a model and records"),
  projects.length ? el("div.known.full", {}, ...projects.slice(0, 5).map((p) => el("button", { type: "button", onclick: () => { dialog.close(); history.pushState(null, "", `/compare?p=${p.id}`); render(); } }, `${p.name}: ${p.records.join(", ")}`))) : null,
  ...field("training", "Records", "paths on this machine, one a line: /data/run1.csv"), ...field("held_out", "Held-out records", "one a line; empty: parts of the records are set aside"),
  ...field("structure", "Structure", "", "select"), ...field("given", "Known values", "K_t_Nm_A=0.05", "input"), ...field("model", "or a model file", "path of a .toml; wins over the structure", "input"),
  ...field("maps", "Columns", "theta_rad=pos:counts/8192, one a line"), error,
  el("div.row.full", {}, el("button.primary", {}, "Open"), el("button", { type: "button", onclick: () => dialog.close() }, "Close")));
  dialog.replaceChildren(form);
  dialog.showModal();
}

function helpDialog() {
  const keys = [["1 … 5", "the pages"], ["← →", "move in time (one finger)"], ["+ −  0", "zoom in, out, all (wheel, two fingers)"], ["a", "add the first missing effect"], ["u", "undo the last effect"], ["r  m", "record, mark (Live)"], ["Enter", "box in the view that has the focus (Tab); arrows move it, Shift and arrows size it"], ["Esc", "clear the selection"], ["o", "open a model and records"], ["c", "copy the address"], ["t", "light or dark"]];
  dialog.replaceChildren(el("h2", {}, "Keys"), el("dl", {}, ...keys.flatMap(([k, v]) => [el("dt", {}, k), el("dd", {}, v)])), el("p.soft", { style: "margin-top:12px" }, "Everything that you see is in the address: send it to a colleague, or use Back."), el("button", { onclick: () => dialog.close() }, "Close"));
  dialog.showModal();
}

async function copyLink() {
  const { token } = await api.json("known", {});
  const url = new URL(location.href);
  if (token) url.searchParams.set("token", token);
  try {
    await navigator.clipboard.writeText(url.href);
    toast("Address copied; it holds the token of this workbench");
  } catch { prompt("Address of what you see", url.href); }
}

function theme(next) {
  const dark = next ?? (document.body.dataset.theme || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light")) !== "dark";
  document.body.dataset.theme = dark ? "dark" : "light";
  localStorage.setItem("driveid-theme", document.body.dataset.theme);
  render();
}

// Start -----------------------------------------------------------------------------------------------------------

const stored = localStorage.getItem("driveid-theme");
if (stored) document.body.dataset.theme = stored;
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => !document.body.dataset.theme && render());
document.getElementById("open-button").onclick = openDialog;
document.getElementById("link-button").onclick = copyLink;
document.getElementById("theme-button").onclick = () => theme();
document.getElementById("help-button").onclick = helpDialog;
const GLOBAL = { o: openDialog, c: copyLink, t: () => theme(), "?": helpDialog };
addEventListener("keydown", (event) => {
  if (dialog.open || event.ctrlKey || event.metaKey || event.altKey || /^(INPUT|TEXTAREA|SELECT)$/.test(document.activeElement?.tagName)) return;
  const number = Number(event.key) - 1;
  if (PAGES[number] && event.key !== "0") state.go({}, PAGES[number][0]);
  else if (GLOBAL[event.key]) { event.preventDefault(); GLOBAL[event.key](); } else if (event.key === "u" && state.page() !== "live" && state.list("add").length) state.go({ add: state.list("add").slice(0, -1).join(","), models: null });
  else current?.keys(event);
});
state.onChange(render);
render().catch((error) => page.replaceChildren(trouble(error)));
