// SPDX-License-Identifier: Apache-2.0
// Page 1: what happens on the gateway now.

import { unpack } from "../api.js";
import { el, toast } from "../dom.js";
import { TimePlot } from "../plots.js";
import * as state from "../state.js";

const AWAY_AFTER_MS = 3000, SILENCE_PERIODS = 5;
let reconnects = 0;

/** Without the empty buckets of a slow drive: a line goes on over them, and breaks where the silence is longer than a few periods. */
function bridged(t, y, silence_s) {
  if (!y.some(Number.isNaN)) return [t, [y]];
  const at = [], values = [];
  for (let k = 0; k < y.length; k++) {
    if (Number.isNaN(y[k])) continue;
    if (at.length && t[k] - at.at(-1) > Math.max(silence_s, 3 * (t[2] - t[0]))) { at.push(t[k] - 1e-6); values.push(NaN); }
    at.push(t[k]);
    values.push(y[k]);
  }
  return at.length ? [Float64Array.from(at), [Float32Array.from(values)]] : [t, [y]];
}

class Signals {
  constructor(place) {
    this.place = place;
    this.plots = [];
  }

  /** New buckets of least and greatest values; the window scrolls, time counts back from now. */
  take(head, values) {
    const n = head.buckets, key = head.signals.map((s) => s.name).join();
    if (key !== this.key) this.build(head, key);
    const shift = this.last === undefined ? n : head.first + head.count - 1 - this.last;
    if (shift < 0 || shift > n) { this.y.forEach((a) => a.fill(NaN)); }
    const kept = Math.max(0, Math.min(n, n - shift));
    const marks = head.marks.map((m) => ({ t: -m.age_s, text: m.text }));
    this.y.forEach((a, k) => {
      this.plots[k].marks = marks;
      a.copyWithin(0, 2 * (n - kept), 2 * n);
      const from = k * head.count * 2, take = Math.min(head.count, n);
      a.fill(NaN, 2 * kept);
      a.set(values.subarray(from + 2 * (head.count - take), from + 2 * head.count), 2 * (n - take));
      this.plots[k].data(...bridged(this.t, a, SILENCE_PERIODS / (head.rate_Hz || Infinity)), this.t[0], 0);
    });
    this.last = head.first + head.count - 1;
  }

  build(head, key) {
    this.plots.forEach((p) => p.destroy());
    const n = head.buckets;
    this.t = new Float64Array(2 * n).map((_, k) => ((k >> 1) - n + 1) * head.bucket_s);
    this.y = head.signals.map(() => new Float32Array(2 * n).fill(NaN));
    const shown = head.signals.slice(0, 8), cards = shown.map(() => el("div.card"));
    this.place.replaceChildren(...cards);
    const few = shown.length <= 3, bottom = few ? 1 : 2;
    this.place.classList.toggle("few", few);
    const height = few ? Math.min(260, Math.max(122, Math.floor((innerHeight - 150) / shown.length) - 40)) : 122;
    this.plots = shown.map((s, k) => new TimePlot(cards[k], [{ name: s.name, colour: "measured", width: 1 }], { title: s.symbol, unit: s.unit, height: height + (k >= shown.length - bottom ? 23 : 0), timeAxis: k >= shown.length - bottom }));
    this.y = this.y.slice(0, 8);
    this.key = key;
    this.last = undefined;
  }

  get draws() { return this.plots.reduce((sum, p) => sum + (p.draws || 0), 0) / Math.max(this.plots.length, 1); }
  destroy() { this.plots.forEach((p) => p.destroy()); }
}

function spark(values) {
  if (values.length < 2) return "";
  const lo = Math.min(...values), span = Math.max(...values) - lo || 1;
  const d = values.map((v, k) => `${k ? "L" : "M"}${((k / (values.length - 1)) * 74 + 1).toFixed(1)} ${(18 - ((v - lo) / span) * 16).toFixed(1)}`).join("");
  return `<svg class="spark" viewBox="0 0 76 20" aria-hidden="true"><path d="${d}"/></svg>`;
}

const text = (s) => { const d = document.createElement("div"); d.textContent = s ?? ""; return d.innerHTML; };

function drive(d, away) {
  const rows = d.parameters.map((p) => `<tr><td>${p.html}</td><td>${text(p.text)}</td><td>${spark(p.trend)}</td><td><span class="lamp ${p.valid && !away ? "good" : "warn"}">${p.valid && !away ? "valid" : "not valid"}</span></td></tr>`).join("");
  return el("section.card", { html: `<div class="lampline"><h2 style="margin:0">${text(d.name)}</h2><span class="soft">${text(d.structure)} ${text(d.method)}</span><span class="lamp ${d.kind}">${text(d.state)}</span></div>
    <div class="lampline"><span class="lamp ${d.lamp}">${text(d.lamp_words)}</span></div>
    ${rows ? `<table><tbody>${rows}</tbody></table>` : `<p class="soft">No parameter yet: ${away ? "the gateway is away" : "it waits for samples"}.</p>`}
    ${d.missing ? `<p class="soft">Needs: ${text(d.missing)}</p>` : ""}<p class="soft" style="margin:6px 0 0;font-size:12.5px">${text(d.rates)}</p>` });
}

function buses(list) {
  const rows = list.map((b) => `<tr><td>${text(b.name)} <span class="soft">${text(b.kind)}</span></td><td><span class="lamp ${b.lamp}">${text([b.state, b.bus_state].filter(Boolean).join(" "))}</span></td><td class="num">${text(b.rate)}</td><td class="num">${b.dropped}</td><td class="num">${b.rejected}</td><td class="num">${b.errors}</td></tr>${b.last_error ? `<tr><td colspan="6" class="soft">${text(b.last_error)}</td></tr>` : ""}`).join("");
  return `<h2>Buses</h2><div class="scroll"><table><thead><tr><th>source</th><th>state</th><th class="num">rate</th><th class="num">dropped</th><th class="num">bad</th><th class="num">errors</th></tr></thead><tbody>${rows || '<tr><td colspan="6" class="soft">no source is configured</td></tr>'}</tbody></table></div>`;
}

export function mount(place) {
  const record = el("button", { onclick: () => send({ cmd: "record" }) }, "● Record");
  const mark = el("button", { onclick: () => { const words = prompt("Text of the mark"); if (words) send({ cmd: "mark", text: words }); } }, "Mark");
  const picks = el("div.row", { style: "margin:0" }), rate = el("span.soft", { title: "pictures drawn in the last second" });
  const banner = el("div"), plots = el("div.plots"), side = el("div");
  const drives = el("div"), health = el("section.card"), events = el("ul.events");
  side.append(drives, health, el("section.card", {}, el("h2", {}, "Events"), events));
  place.replaceChildren(el("div.row", {}, picks, el("span.space"), rate, mark, record), banner, el("div.live", {}, plots, side));
  const signals = new Signals(plots);
  let socket, gone = false, seen = 0, timer, lastText = "";
  const send = (message) => socket?.readyState === 1 && socket.send(JSON.stringify(message));

  /** Nothing was seen yet: how a gateway comes to this page. */
  function hint(address) {
    if (plots.querySelector(".hint")) return;
    plots.classList.add("few");
    plots.replaceChildren(el("section.card.hint", {}, el("h2", {}, "What this page shows once a gateway runs"),
      el("p", {}, "The drives, their signals of the last 10 s, the parameters with intervals as they arrive, whether the model still fits, and the health of each bus."),
      el("pre", {}, `driveid config new -o driveidd.toml       # then say where the signals are on the bus\ndriveidd --check driveidd.toml\ndriveidd driveidd.toml\ndriveid workbench --socket ${address}`),
      el("div.row", { style: "margin:10px 0 0" }, el("button.primary", { onclick: () => state.go({}, "compare") }, "Look at records instead"))));
  }

  function show(panel) {
    const away = !panel.connected;
    document.body.dataset.gateway = away ? "away" : "up";
    banner.replaceChildren(...(away ? [el("section.card.banner", { html: `<b>The gateway does not answer.</b> ${text(panel.trouble)}. It is tried again every second (away for ${Math.round(panel.since_s)} s).` })] : []));
    if (away && !panel.drives.length) hint(panel.address);
    plots.classList.toggle("away", away && panel.drives.length > 0);
    health.hidden = away && !panel.drives.length;
    record.textContent = panel.recording ? "■ Stop recording" : "● Record";
    record.classList.toggle("on", Boolean(panel.recording));
    record.disabled = mark.disabled = away || !panel.write;
    record.title = mark.title = panel.write ? panel.recording : "This connection only reads: set [control] write_group in the daemon's configuration, and join that group.";
    const chosen = state.get("drive") || panel.drives[0]?.name;
    picks.replaceChildren(...panel.drives.map((d) => el("button.chip", { "aria-pressed": String(d.name === chosen), onclick: () => { state.keep({ drive: d.name }); send({ drive: d.name }); lastText = ""; show(panel); } }, el(`span.lamp.${d.kind}`, { "aria-label": d.state }), d.name)));
    const compact = JSON.stringify([panel.drives, panel.buses, panel.events, chosen, away]);
    if (compact === lastText) return;
    lastText = compact;
    drives.replaceChildren(...panel.drives.filter((d) => d.name === chosen).map((d) => drive(d, away)));
    health.innerHTML = buses(panel.buses) + (panel.lost ? `<p class="soft">${panel.lost} messages were lost because this page was slow.</p>` : "");
    events.replaceChildren(...panel.events.slice().reverse().map((e) => el("li", {}, el("time", {}, new Date(e.wall * 1000).toLocaleTimeString("en-GB")), el(`span.${e.level}`, {}, `${e.component}: ${e.text}${e.mend ? ` → ${e.mend}` : ""}${e.count > 1 ? ` (${e.count} times)` : ""}`))));
    if (!panel.events.length) events.replaceChildren(el("li.soft", {}, "nothing to tell"));
  }

  function connect() {
    socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws/live?drive=${encodeURIComponent(state.get("drive"))}`);
    socket.binaryType = "arraybuffer";
    socket.onmessage = ({ data }) => {
      seen = performance.now();
      const { head, arrays } = unpack(data);
      if (head.panel) show(head.panel);
      if (head.signals && arrays.values) signals.take(head, arrays.values);
      requestAnimationFrame(() => socket.readyState === 1 && socket.send("drawn"));
    };
    socket.onclose = () => { if (!gone) timer = setTimeout(() => { reconnects++; connect(); }, 1000); };
  }
  connect();
  let before = 0, at = performance.now();
  const watch = setInterval(() => {
    const now = performance.now(), drawn = signals.draws;
    if (drawn > before) rate.textContent = `${((drawn - before) / (now - at) * 1000).toFixed(0)} pictures/s`;
    [before, at] = [drawn, now];
    window.driveidRedraws = drawn;
    if (seen && now - seen > AWAY_AFTER_MS) banner.replaceChildren(el("section.card.banner", {}, el("b", {}, "The workbench does not answer. "), "Was it stopped in its terminal? It is tried again every second."));
  }, 1000);
  const keys = (e) => { if (e.key === "r" && !record.disabled) { record.click(); toast("record"); } else if (e.key === "m" && !mark.disabled) mark.click(); };
  return { keys, destroy() { gone = true; clearTimeout(timer); clearInterval(watch); socket.close(); signals.destroy(); delete document.body.dataset.gateway; } };
}
