// SPDX-License-Identifier: Apache-2.0
// Page 3: the residual against everything it may depend on; a box in one view lights its points in all others.

import * as api from "../api.js";
import { Cloud } from "../cloud.js";
import { el, into } from "../dom.js";
import { TimePlot } from "../plots.js";
import * as state from "../state.js";

const DIRECTIONS = [[-1, "reverse"], [0, "rest"], [1, "forward"]];

export function mount(place, { project, signal }) {
  let clouds = [], line, act = () => {};
  const record = state.get("r", "0").split("+")[0];
  const chips = project.records.map((r, k) => el("button.chip", { "aria-pressed": String(String(k) === record), onclick: () => state.go({ r: k, sel: null }) }, `${r.name} (${r.role})`));
  const count = el("span.soft", { role: "status" }), clear = el("button", { onclick: () => act(null), hidden: true }, "Clear selection");
  const body = el("div"), pick = el("span");
  place.replaceChildren(el("div.row", {}, ...chips, pick, el("span.space"), count, clear), body);

  into(body, signal, "looking where it fails", async (options) => {
    const { head, arrays } = await api.binary("where", { p: project.id, add: state.get("add"), r: record, eq: state.get("eq") }, options);
    if (head.equations.length > 1) pick.replaceChildren(el("select", { "aria-label": "which equation", onchange: (e) => state.go({ eq: e.target.value, sel: null }) }, ...head.equations.map((q) => el("option", { value: q.name, selected: q.name === head.equation }, q.title))));
    const time = el("section.card.tight"), grid = el("div.clouds"), held = el("div"), bars = el("section.card", {}, el("h2", {}, "What holds the error"), held);
    body.replaceChildren(el("div.where", {}, bars, el("div", {}, time, grid)));
    const y = arrays.residual, mask = new Uint8Array(y.length), lit = new Float32Array(y.length).fill(NaN);
    time.append(el("div.cap", {}, el("b", {}, "residual against time"), el("span", {}, `${head.points.toLocaleString("en")} of ${head.rows.toLocaleString("en")} samples`)));
    line = new TimePlot(time, [{ name: "residual", colour: "residual", width: 1 }, { name: "selected", colour: "select", points: true }], {
      title: "residual", unit: head.unit, height: 114, onZoom: (a, b) => choose({ key: "t_s", x0: a, x1: b, y0: -Infinity, y1: Infinity }) });
    const column = (key) => (key === "t_s" ? arrays.t : arrays[key]);
    clouds = head.coordinates.filter((c) => c.key !== "t_s").map((c) => {
      const canvas = el("canvas", { "data-key": c.key, tabindex: "0", "aria-label": `residual against ${c.title}: Enter makes a box, arrows move it, Shift and arrows change its size` });
      grid.append(el("figure", {}, el("figcaption", {}, c.title), canvas));
      return Object.assign(new Cloud(canvas, column(c.key), y, { title: c.title, unit: c.unit, yUnit: head.unit, words: c.key === "direction" ? DIRECTIONS : null, onSelect: (b) => choose(b && { key: c.key, ...b }) }), { key: c.key });
    });
    if (arrays.frequency.length) {
      const canvas = el("canvas", { "aria-label": "residual against frequency", style: "cursor:default" });
      grid.append(el("figure", {}, el("figcaption", {}, "frequency (amplitude)"), canvas));
      clouds.push(new Cloud(canvas, arrays.frequency, arrays.amplitude, { title: "frequency", unit: "Hz", yUnit: head.unit, log: true, line: true }));
    }

    function choose(box, remember = true) {
      let n = 0;
      lit.fill(NaN);
      if (box) {
        const x = column(box.key);
        for (let k = 0; k < y.length; k++) {
          const v = box.abs ? Math.abs(x[k]) : x[k];
          mask[k] = v >= box.x0 && v <= box.x1 && y[k] >= box.y0 && y[k] <= box.y1 ? 1 : 0;
          if (mask[k]) { n++; lit[k] = y[k]; }
        }
      }
      clouds.forEach((c) => c.key && c.select(box ? mask : null, box && c.key === box.key && Number.isFinite(box.y0) ? box : null));
      line.data(arrays.t, [y, lit], project.records[record].t0, project.records[record].t1);
      count.textContent = box ? `${n.toLocaleString("en")} points selected` : "drag a box in any view";
      count.dataset.selected = n;
      clear.hidden = !box;
      if (remember) state.keep({ sel: box ? [box.abs ? `${box.key}|` : box.key, ...[box.x0, box.x1, box.y0, box.y1].map((v) => (Number.isFinite(v) ? v.toPrecision(5) : v > 0 ? "inf" : "-inf"))].join(",") : null });
    }
    act = choose;
    into(held, signal, "asking which part holds the error", async (o) => {
      const { html, boxes } = await api.json("regimes", { p: project.id, add: state.get("add") }, o);
      const list = el("div", { html }), spans = [...list.querySelectorAll(".coordinate")];
      boxes.forEach((box, k) => {
        if (!box || !spans[k] || !column(box.key)) return;
        spans[k].classList.add("pick");
        Object.assign(spans[k], { title: "show these points", tabIndex: 0, role: "button" });
        spans[k].addEventListener("keydown", (e) => e.key === "Enter" && spans[k].click());
        spans[k].addEventListener("click", () => choose({ key: box.key, x0: box.lo, x1: box.hi, y0: -Infinity, y1: Infinity, abs: box.abs }));
      });
      return list;
    });
    const [named, ...edges] = state.list("sel"), abs = named?.endsWith("|"), key = named?.replace("|", "");
    const number = (s) => (s === "inf" ? Infinity : s === "-inf" ? -Infinity : Number(s));
    const known = key && edges.length === 4 && column(key);
    choose(known ? { key, x0: number(edges[0]), x1: number(edges[1]), y0: number(edges[2]), y1: number(edges[3]), abs } : null, false);
    return null;
  });
  return { keys: (e) => e.key === "Escape" && act(null), destroy() { clouds.forEach((c) => c.destroy()); line?.destroy(); } };
}
