// SPDX-License-Identifier: Apache-2.0
// Time plots with uPlot: one look for all pages, one cursor for plots that belong together, zoom that asks for detail.
/* global uPlot */

import { colour } from "./dom.js";
import { scaleOf } from "./units.js";

const FONT = "11px system-ui, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif";

/** Least and greatest value of what is in view; missing values (NaN) do not count. */
function extent(data, [begin, end]) {
  const t = data[0];
  let lo = Infinity, hi = -Infinity;
  for (let s = 1; s < data.length; s++) {
    const a = data[s];
    for (let k = 0; k < t.length; k++) {
      if (t[k] < begin || t[k] > end) continue;
      if (a[k] < lo) lo = a[k];
      if (a[k] > hi) hi = a[k];
    }
  }
  return [lo, hi];
}

/** uPlot breaks a line at null, not at NaN. */
function gaps(values) {
  return values.some(Number.isNaN) ? Array.from(values, (v) => (Number.isNaN(v) ? null : v)) : values;
}

/** Fewest decimals that write a step without rounding it. */
export function decimals(step) {
  for (let d = 0; d < 9; d++) if (Math.abs(step * 10 ** d - Math.round(step * 10 ** d)) < 1e-6 * Math.max(1, step * 10 ** d)) return d;
  return 9;
}

function axis(title, unit, size, side) {
  let divisor = 1, words = unit;
  return {
    stroke: () => colour("soft"), font: FONT, labelFont: FONT, size, labelSize: title ? (side === 3 ? 16 : 15) : 0, labelGap: 0, gap: 3,
    grid: { stroke: () => colour("line"), width: 1 }, ticks: { show: false }, side, space: side === 3 ? 20 : 70,
    label: title,
    splits: undefined,
    values: (u, splits) => {
      const top = Math.max(...splits.map(Math.abs));
      [divisor, words] = scaleOf(top, unit);
      const step = splits.length > 1 ? Math.abs(splits[1] - splits[0]) / divisor : 1;
      const digits = decimals(step);
      const own = u.axes.find((a) => a.side === side);
      const label = title && words ? `${title} / ${words}` : title;
      if (own && own.label !== label) own.label = label;
      return splits.map((v) => (v / divisor).toFixed(digits).replace("-", "−"));
    },
  };
}

/** series: [{name, colour, width, dash, points}], all of one unit. options: {title, unit, height, timeAxis, sync, onZoom, band}. */
export class TimePlot {
  constructor(place, series, options) {
    this.place = place;
    this.span = [0, 1];
    this.raw = [[0]];
    this.options = options;
    const lines = series.map((s) => ({
      label: s.name, stroke: () => colour(s.colour), width: s.width ?? 1.2, dash: s.dash, points: { show: Boolean(s.points), size: 4, fill: () => colour(s.colour) },
      paths: s.points ? () => null : undefined, spanGaps: false,
    }));
    this.plot = new uPlot({
      width: Math.max(place.clientWidth, 80), height: options.height, legend: { show: false }, ms: 1e-3,
      cursor: { drag: { x: Boolean(options.onZoom), y: false, setScale: false, dist: 5 }, sync: options.sync ? { key: options.sync, scales: ["x", null] } : undefined, points: { size: 5 }, x: true, y: false },
      scales: { x: { time: false, range: () => this.span }, y: { range: () => this.range(...extent(this.raw, this.span)) } },
      padding: [6, 12, 0, 0],
      axes: [options.timeAxis === false ? { ...axis("", "", 6, 2), values: (u, splits) => splits.map(() => "") } : axis("time", "s", 18, 2), axis(options.title, options.unit, 46, 3)],
      series: [{}, ...lines],
      hooks: { draw: [(u) => { this.draws = (this.draws || 0) + 1; this.flags(u); }], setSelect: [(u) => this.selected(u)] },
    }, [[0], ...series.map(() => [0])], place);
    this.resize = new ResizeObserver(() => {
      const width = Math.floor(place.clientWidth);
      if (width > 60 && Math.abs(width - this.plot.width) > 1) this.plot.setSize({ width, height: options.height });
    });
    this.resize.observe(place);
  }

  /** Dashed lines with a word each: this.marks = [{t, text}]. */
  flags(u) {
    const c = u.ctx, { top, height, left, width } = u.bbox, ratio = devicePixelRatio || 1;
    for (const { t, text } of this.marks || []) {
      const x = u.valToPos(t, "x", true);
      if (x < left || x > left + width) continue;
      c.save();
      c.strokeStyle = c.fillStyle = colour("select");
      c.setLineDash([4 * ratio, 3 * ratio]);
      c.lineWidth = ratio;
      c.beginPath();
      c.moveTo(x, top);
      c.lineTo(x, top + height);
      c.stroke();
      c.font = `${11 * ratio}px system-ui, sans-serif`;
      c.textAlign = x > left + width / 2 ? "right" : "left";
      c.fillText(text, x + (x > left + width / 2 ? -4 : 4) * ratio, top + 11 * ratio);
      c.restore();
    }
  }

  range(lo, hi) {
    if (!Number.isFinite(lo) || !Number.isFinite(hi)) return [0, 1];
    const air = hi > lo ? 0.06 * (hi - lo) : Math.abs(hi) * 0.1 || 1;
    return [lo - air, hi + air];
  }

  /** New values; the x axis shows begin to end, the y axis what is in it. */
  data(t, values, begin = t[0], end = t[t.length - 1]) {
    this.span = [begin, end];
    this.raw = [t, ...values];
    this.plot.setData([t, ...values.map(gaps)], true);
  }

  /** A span that was dragged is asked for, and its mark goes. */
  selected(u) {
    const { left, width } = u.select;
    if (width < 3 || !this.options.onZoom) return;
    const [begin, end] = [u.posToVal(left, "x"), u.posToVal(left + width, "x")];
    u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    this.options.onZoom(begin, end);
  }

  destroy() {
    this.resize.disconnect();
    this.plot.destroy();
  }
}

/** On a tablet: one finger moves, two zoom. */
function fingers(element, pan, zoom) {
  const down = new Map();
  element.addEventListener("pointerdown", (e) => e.pointerType === "touch" && down.set(e.pointerId, e.clientX));
  for (const end of ["pointerup", "pointercancel", "pointerleave"]) element.addEventListener(end, (e) => down.delete(e.pointerId));
  element.addEventListener("pointermove", (e) => {
    if (!down.has(e.pointerId)) return;
    const box = element.getBoundingClientRect(), width = box.width - 94, before = down.get(e.pointerId);
    const other = [...down].find(([id]) => id !== e.pointerId)?.[1];
    down.set(e.pointerId, e.clientX);
    if (other === undefined) pan((before - e.clientX) / width);
    else zoom(Math.abs(before - other) / Math.max(Math.abs(e.clientX - other), 8), Math.min(1, Math.max(0, ((e.clientX + other) / 2 - box.left - 72) / width)));
  });
}

/** Wheel, arrows, + and - move a window of time; the caller asks for the data. */
export function navigate(element, view) {
  const { full, now, set } = view;
  const move = (a, b) => {
    const [f0, f1] = full();
    const span = Math.min(Math.max(b - a, (f1 - f0) * 1e-6), f1 - f0);
    const begin = Math.min(Math.max(a, f0), f1 - span);
    set(begin, begin + span);
  };
  const zoom = (factor, at = 0.5) => { const [a, b] = now(); const c = a + at * (b - a); move(c - (c - a) * factor, c + (b - c) * factor); };
  const pan = (part) => { const [a, b] = now(); move(a + part * (b - a), b + part * (b - a)); };
  const wheel = (event) => {
    if (!event.ctrlKey && !event.shiftKey && !event.altKey && Math.abs(event.deltaY) < Math.abs(event.deltaX)) return;
    event.preventDefault();
    const box = element.getBoundingClientRect();
    if (event.shiftKey) pan(Math.sign(event.deltaY) * 0.15);
    else zoom(event.deltaY > 0 ? 1.25 : 0.8, Math.min(1, Math.max(0, (event.clientX - box.left - 72) / (box.width - 94))));
  };
  element.addEventListener("wheel", wheel, { passive: false });
  fingers(element, pan, zoom);
  const keys = { ArrowLeft: () => pan(-0.25), ArrowRight: () => pan(0.25), "+": () => zoom(0.5), "=": () => zoom(0.5), "-": () => zoom(2), 0: () => set(...full()) };
  return (event) => { if (keys[event.key]) { event.preventDefault(); keys[event.key](); } };
}
