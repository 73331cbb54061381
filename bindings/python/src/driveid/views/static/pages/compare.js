// SPDX-License-Identifier: Apache-2.0
// Page 2: measurement over model, residual under it, errors beside the noise floor.

import * as api from "../api.js";
import { el, into, trouble } from "../dom.js";
import { TimePlot, navigate } from "../plots.js";
import * as state from "../state.js";
import { seconds } from "../units.js";

const MODEL = [{ colour: "model0", width: 1.6 }, { colour: "model1", width: 1.6, dash: [6, 3] }, { colour: "model2", width: 1.6, dash: [2, 3] }, { colour: "model3", width: 1.6, dash: [8, 3] }];

const MODEL_LATE_MS = 700;

/** Prefixes of the chain that are drawn: "" is the first model, "coulomb" the next. The newest one if the address names none. */
function chosenModels(project) {
  const chain = project.chain.map((c) => c.name);
  const all = chain.map((_, k) => chain.slice(0, k + 1).join(","));
  const models = [{ key: "0", chain: "", title: "first model" }, ...all.map((c, k) => ({ key: String(k + 1), chain: c, title: `+ ${project.chain[k].title}` }))];
  project.others.forEach((title, k) => models.push({ key: `o${k}`, other: k, title }));
  const wanted = state.list("models");
  const on = models.filter((m) => (wanted.length ? wanted.includes(m.key) : m.key === String(chain.length)));
  return { models, on: on.length ? on : [models[chain.length]] };
}

/** One record: overlay and residual, or all signals; zoom asks the server for detail. */
class View {
  constructor(project, record, signal, on, signal_abort) {
    Object.assign(this, { project, record, signal, on, abort: signal_abort });
    this.full = [project.records[record].t0, project.records[record].t1];
    const t = state.list("t").map(Number);
    this.now = t.length === 2 && t[1] > t[0] ? [Math.max(t[0], this.full[0]), Math.min(t[1], this.full[1])] : this.full;
    if (!(this.now[1] > this.now[0])) this.now = this.full;
    this.box = el("section.card.tight", { tabindex: "0" });
    this.words = el("span");
    this.plots = [];
    this.name = `view${record}`;
    this.keys = navigate(this.box, { full: () => this.full, now: () => this.now, set: (a, b) => this.zoom(a, b) });
  }

  /** Asks for the detail; while an answer is on its way, only the newest wish is kept. */
  async zoom(a, b) {
    this.now = [a, b];
    if (this.busy) return;
    for (this.busy = true; this.shown !== this.now && !this.abort.aborted;) {
      const [begin, end] = (this.shown = this.now);
      state.keep({ t: begin <= this.full[0] && end >= this.full[1] ? null : `${begin.toPrecision(9)},${end.toPrecision(9)}` });
      await this.load().catch((e) => e.name === "AbortError" || this.box.replaceChildren(trouble(e)));
    }
    this.busy = false;
  }

  async load() {
    const asked = performance.now();
    const query = { p: this.project.id, r: this.record, t0: this.now[0], t1: this.now[1], px: Math.min(1600, Math.max(200, Math.floor(this.box.clientWidth - 90))) };
    if (this.signal === "signals") query.names = this.project.signals.map((s) => s.name).slice(0, 8).join(",");
    else Object.assign(query, { pair: this.signal, chains: this.on.filter((m) => m.chain !== undefined).map((m) => m.chain).join("|"), others: this.on.filter((m) => m.other !== undefined).map((m) => m.other).join(",") });
    if (query.chains === "" && !this.on.some((m) => m.chain !== undefined)) delete query.chains;
    const number = (this.asked = (this.asked || 0) + 1);
    const { head, arrays } = await api.binary("trace", query, { signal: this.abort, progress: (done, what) => { this.words.textContent = `${what} …`; } });
    if (number !== this.asked || this.abort.aborted) return;
    this.draw(head, arrays);
    window.driveidTraceMs = performance.now() - asked;
  }

  build(head) {
    const r = this.project.records[this.record];
    this.plots.forEach((p) => p.destroy());
    const cap = el("div.cap", {}, el("span", {}, el("b", {}, r.name), ` ${r.role}, ${r.span}, ${r.rows.toLocaleString("en").replaceAll(",", " ")} rows`), this.words);
    const zoomed = { sync: this.name, onZoom: (a, b) => this.zoom(a, b) };
    if (this.signal === "signals") {
      const places = head.names.map(() => el("div"));
      this.box.replaceChildren(cap, ...places);
      const height = Math.max(74, Math.min(150, Math.floor((innerHeight - 210) / head.names.length)));
      this.plots = head.names.map((n, k) => new TimePlot(places[k], [{ name: n, colour: "measured" }], { title: head.symbols[k], unit: head.units[k], height: height + (k === head.names.length - 1 ? 18 : 0), timeAxis: k === head.names.length - 1, ...zoomed }));
      return;
    }
    const legend = el("div.legend", {}, head.only ? null : el("span.measured", {}, "measured"), ...head.models.map((m, k) => el(`span.model${k}`, {}, m)));
    const top = el("div"), low = el("div");
    this.box.replaceChildren(cap, legend, top, low);
    const models = head.models.map((m, k) => ({ name: m, ...MODEL[k % 4] }));
    const room = Math.max(300, innerHeight - 430);
    const residuals = models.map((m, k) => ({ ...m, colour: head.models.length === 1 ? "residual" : m.colour, dash: undefined, width: 1, k }));
    if (head.only) {
      this.plots = [new TimePlot(top, residuals, { title: "residual", unit: head.unit, height: room + 16, ...zoomed })];
      return;
    }
    this.plots = [
      new TimePlot(top, [{ name: "measured", colour: "measured", width: 1.1 }, ...models], { title: head.symbol, unit: head.unit, height: Math.round(room * 0.62), timeAxis: false, ...zoomed }),
      new TimePlot(low, residuals, { title: "residual", unit: head.unit, height: Math.round(room * 0.38) + 16, ...zoomed }),
    ];
  }

  draw(head, a) {
    const key = JSON.stringify([head.names, head.models, head.only]);
    if (key !== this.key) this.build(head);
    this.key = key;
    const [begin, end] = this.now;
    if (this.signal === "signals") head.names.forEach((n, k) => this.plots[k].data(a.t, [a[n]], begin, end));
    else {
      if (!head.only) this.plots[0].data(a.t, [a.measured, ...head.models.map((_, k) => a[`model${k}`])], begin, end);
      this.plots.at(-1).data(a.t, head.models.map((_, k) => a[`residual${k}`]), begin, end);
    }
    const whole = begin <= this.full[0] && end >= this.full[1];
    this.words.textContent = whole ? "drag or wheel to zoom, 0 for all" : `${seconds(begin)} … ${seconds(end)}`;
  }

  destroy() { this.plots.forEach((p) => p.destroy()); }
}

export function mount(place, { project, signal: abort }) {
  const base = { p: project.id, add: state.get("add"), r: state.get("r", "0") };
  const bar = el("div.row"), plots = el("div"), table = el("section.card"), views = [];
  place.replaceChildren(bar, plots, table);
  const both = project.records.length > 1;
  const records = state.get("r", "0").split("+").map(Number).filter((k) => k < project.records.length);
  const { models, on } = chosenModels(project);

  function choices(pairs, signal) {
    const pick = el("select", { "aria-label": "what is drawn", onchange: (e) => state.go({ s: e.target.value }) },
      ...pairs.map((p) => el("option", { value: p.name, selected: p.name === signal }, p.title)), el("option", { value: "signals", selected: signal === "signals" }, "all measured signals"));
    const chips = project.records.map((r, k) => el("button.chip", { "aria-pressed": String(records.length === 1 && records[0] === k), onclick: () => state.go({ r: k, t: null }) }, `${r.name} (${r.role})`));
    if (both) chips.push(el("button.chip", { "aria-pressed": String(records.length > 1), onclick: () => state.go({ r: `0+${project.records.length - 1}`, t: null }) }, "side by side"));
    const toggles = signal === "signals" ? [] : models.map((m) => {
      const k = on.indexOf(m), rest = on.filter((o) => o !== m).map((o) => o.key);
      return el("button.chip", { "aria-pressed": String(k >= 0), onclick: () => state.go({ models: (k >= 0 ? (rest.length ? rest : [m.key]) : [...rest, m.key]).join(",") }) }, k >= 0 ? el(`span.swatch.k${k}`) : null, m.title);
    });
    bar.replaceChildren(...chips, el("span.space"), ...toggles, pick);
  }

  function draw(signal) {
    views.splice(0).forEach((v) => v.destroy());
    views.push(...(records.length ? records : [0]).map((r) => new View(project, r, signal, on, abort)));
    plots.className = views.length > 1 ? "halves" : "";
    plots.replaceChildren(...views.map((v) => v.box));
    return Promise.all(views.map((v) => v.load().catch((e) => e.name === "AbortError" || v.box.replaceChildren(trouble(e)))));
  }

  // The measured signals need no model. They come at once where they are asked for (the fit gets the processors afterwards),
  // and where the model takes its time.
  const wanted = state.get("s");
  let shown = null;
  const signals = () => { shown = "signals"; choices([], shown); return draw(shown); };
  const first = wanted === "signals" ? signals() : null;
  const late = first ? 0 : setTimeout(() => shown || abort.aborted || signals(), MODEL_LATE_MS);
  into(table, abort, "comparing", async (options) => {
    await first;
    let answer;
    try { answer = await api.json("compare", { ...base, r: records[0] ?? 0 }, options); } finally { clearTimeout(late); }
    if (abort.aborted) return null;
    const signal = first ? "signals" : answer.pairs.find((p) => p.name === wanted)?.name ?? answer.pairs[0]?.name ?? "signals";
    choices(answer.pairs, signal);
    if (signal !== shown) draw(signal);
    const notes = answer.notices.map((n) => `<li>${n.replaceAll("<", "&lt;")}</li>`).join("");
    return el("div", { html: `<h2>Errors of “${answer.model}”</h2>${answer.errors}${notes ? `<ul class="notices">${notes}</ul>` : ""}${answer.tests ? `<details><summary>Tests of the residual</summary>${answer.tests}</details>` : ""}` });
  });
  return {
    keys(event) { const v = views.find((x) => x.box.contains(document.activeElement)) || views[0]; v?.keys(event); },
    destroy() { clearTimeout(late); views.forEach((v) => v.destroy()); },
  };
}
