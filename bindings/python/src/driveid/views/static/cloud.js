// SPDX-License-Identifier: Apache-2.0
// One cloud of points on a canvas: drag a box, and the points in it are selected in every view.

import { colour } from "./dom.js";
import { decimals } from "./plots.js";
import { scaleOf } from "./units.js";

const LEFT = 46, RIGHT = 8, TOP = 6, BOTTOM = 30;

function nice(span, most) {
  const raw = span / most, power = 10 ** Math.floor(Math.log10(raw));
  return [1, 2, 5, 10].map((f) => f * power).find((s) => s >= raw * 0.999999);
}

const superscript = (n) => String(n).replace(/[-\d]/g, (c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[c]));

function limits(values, zero) {
  const finite = Float64Array.from(values).filter(Number.isFinite).sort();
  if (!finite.length) return [0, 1];
  const at = (p) => finite[Math.round(p * (finite.length - 1))];
  let lo = zero ? at(0.002) : finite[0], hi = zero ? at(0.998) : finite[finite.length - 1];
  if (zero) { lo = Math.min(lo, 0); hi = Math.max(hi, 0); }
  const air = hi > lo ? 0.05 * (hi - lo) : Math.abs(hi) * 0.1 || 1;
  return [lo - air, hi + air];
}

export class Cloud {
  /** x, y: arrays of equal length. onSelect({x0, x1, y0, y1} or null). */
  constructor(canvas, x, y, { title, unit, yUnit, onSelect, words = null, log = false, line = false }) {
    Object.assign(this, { canvas, x, y, title, unit, yUnit, onSelect, words, line });
    this.fx = log ? (v) => Math.log10(Math.max(v, 1e-30)) : (v) => v;
    this.fy = this.fx;
    this.log = log;
    this.xr = limits(Array.from(x, this.fx), false);
    this.yr = limits(Array.from(y, this.fy), !log);
    if (log) this.yr[0] = Math.max(this.yr[0], this.yr[1] - 5);
    this.mask = null;
    if (onSelect) this.listen();
    this.observer = new ResizeObserver(() => this.draw());
    this.observer.observe(canvas);
  }

  px(v) { return LEFT + ((this.fx(v) - this.xr[0]) / (this.xr[1] - this.xr[0])) * (this.width - LEFT - RIGHT); }
  py(v) { return this.height - BOTTOM - ((this.fy(v) - this.yr[0]) / (this.yr[1] - this.yr[0])) * (this.height - TOP - BOTTOM); }
  ix(p) { return this.xr[0] + ((p - LEFT) / (this.width - LEFT - RIGHT)) * (this.xr[1] - this.xr[0]); }
  iy(p) { return this.yr[0] + ((this.height - BOTTOM - p) / (this.height - TOP - BOTTOM)) * (this.yr[1] - this.yr[0]); }

  select(mask, box = null) {
    this.mask = mask;
    this.box = box;
    this.draw();
  }

  draw() {
    const ratio = devicePixelRatio || 1;
    this.width = this.canvas.clientWidth;
    this.height = this.canvas.clientHeight;
    if (!this.width) return;
    this.canvas.width = this.width * ratio;
    this.canvas.height = this.height * ratio;
    const c = this.canvas.getContext("2d");
    c.scale(ratio, ratio);
    this.axes(c);
    c.save();
    c.beginPath();
    c.rect(LEFT, TOP, this.width - LEFT - RIGHT, this.height - TOP - BOTTOM);
    c.clip();
    if (this.line) this.curve(c);
    else this.points(c);
    if (this.box) this.frame(c, this.box);
    c.restore();
  }

  points(c) {
    const { x, y, mask } = this;
    c.globalAlpha = mask ? 0.18 : 0.4;
    c.fillStyle = colour("residual");
    for (let k = 0; k < x.length; k++) if (!mask || !mask[k]) c.fillRect(this.px(x[k]) - 1, this.py(y[k]) - 1, 2, 2);
    if (!mask) { c.globalAlpha = 1; return; }
    c.globalAlpha = 0.9;
    c.fillStyle = colour("select");
    for (let k = 0; k < x.length; k++) if (mask[k]) c.fillRect(this.px(x[k]) - 1.5, this.py(y[k]) - 1.5, 3, 3);
    c.globalAlpha = 1;
  }

  curve(c) {
    c.strokeStyle = colour("residual");
    c.lineWidth = 1.2;
    c.beginPath();
    for (let k = 0; k < this.x.length; k++) c.lineTo(this.px(this.x[k]), this.py(this.y[k]));
    c.stroke();
  }

  frame(c, { x0, x1, y0, y1 }) {
    const a = this.px(x0), b = this.px(x1), d = this.py(y0), e = this.py(y1);
    c.strokeStyle = colour("select");
    c.lineWidth = 1.5;
    c.setLineDash([4, 3]);
    c.strokeRect(Math.min(a, b), Math.min(d, e), Math.abs(b - a), Math.abs(e - d));
    c.setLineDash([]);
  }

  marks(range, unit, most) {
    if (this.words && range === this.xr) return [this.words, ""];
    if (this.log) {
      const out = [];
      for (let p = Math.ceil(range[0]); p <= range[1]; p++) out.push([p, 10 ** p >= 1e-2 && 10 ** p < 1e4 ? String(+(10 ** p).toPrecision(3)) : `10${superscript(p)}`]);
      const every = Math.ceil(out.length / most);
      return [out.filter((_, k) => k % every === 0), unit];
    }
    const step = nice(range[1] - range[0], most), [divisor, words] = scaleOf(Math.max(Math.abs(range[0]), Math.abs(range[1])), unit);
    const out = [], digits = decimals(step / divisor);
    for (let k = Math.ceil(range[0] / step); k * step <= range[1]; k++) out.push([k * step, ((k * step) / divisor).toFixed(digits).replace("-", "−")]);
    return [out, words];
  }

  axes(c) {
    c.font = "11px system-ui, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif";
    c.lineWidth = 1;
    c.fillStyle = colour("soft");
    c.strokeStyle = colour("line");
    const [xs, xUnit] = this.marks(this.xr, this.unit, Math.max(3, Math.floor(this.width / 52))), [ys, yUnit] = this.marks(this.yr, this.yUnit, Math.max(2, Math.floor(this.height / 34)));
    const right = this.width - RIGHT, base = this.height - BOTTOM;
    c.textAlign = "center";
    for (const [v, text] of xs) { const p = LEFT + ((v - this.xr[0]) / (this.xr[1] - this.xr[0])) * (right - LEFT); c.beginPath(); c.moveTo(p, TOP); c.lineTo(p, base); c.stroke(); const half = c.measureText(text).width / 2; c.fillText(text, Math.min(Math.max(p, half), this.width - half - 1), base + 12); }
    c.textAlign = "right";
    for (const [v, text] of ys) { const p = base - ((v - this.yr[0]) / (this.yr[1] - this.yr[0])) * (base - TOP); c.beginPath(); c.moveTo(LEFT, p); c.lineTo(right, p); c.stroke(); c.fillText(text, LEFT - 4, p + 4); }
    c.textAlign = "right";
    c.fillText(xUnit ? `/ ${xUnit}` : "", right, base + 25);
    c.save();
    c.translate(10, TOP);
    c.rotate(-Math.PI / 2);
    c.fillText(yUnit ? `/ ${yUnit}` : "", 0, 0);
    c.restore();
  }

  listen() {
    const at = (e) => { const r = this.canvas.getBoundingClientRect(); return [e.clientX - r.left, e.clientY - r.top]; };
    let from = null;
    this.canvas.addEventListener("pointerdown", (e) => { from = at(e); this.canvas.setPointerCapture(e.pointerId); });
    this.canvas.addEventListener("pointermove", (e) => { if (from) { this.box = this.between(from, at(e)); this.draw(); } });
    this.canvas.addEventListener("pointerup", (e) => {
      const to = at(e), moved = from && Math.hypot(to[0] - from[0], to[1] - from[1]) > 4;
      const box = moved ? this.between(from, to) : null;
      from = null;
      this.onSelect(box);
    });
    this.canvas.addEventListener("keydown", (e) => this.steer(e));
  }

  /** Without a mouse: Enter makes a box, arrows move it by a twentieth of the view, with Shift they move its far edges. */
  steer(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const w = this.xr[1] - this.xr[0], h = this.yr[1] - this.yr[0];
    const move = { ArrowLeft: [-0.05 * w, 0], ArrowRight: [0.05 * w, 0], ArrowUp: [0, 0.05 * h], ArrowDown: [0, -0.05 * h] }[event.key];
    if (event.key !== "Enter" && !move) return;
    event.preventDefault();
    event.stopPropagation();
    const middle = { x0: this.xr[0] + 0.375 * w, x1: this.xr[0] + 0.625 * w, y0: this.yr[0] + 0.25 * h, y1: this.yr[0] + 0.75 * h };
    const { x0, x1, y0, y1 } = this.box && Number.isFinite(this.box.y0) ? this.box : middle;
    const [dx, dy] = move ?? [0, 0], near = event.shiftKey ? 0 : 1;
    this.onSelect({ x0: x0 + near * dx, x1: Math.max(x1 + dx, x0 + near * dx), y0: y0 + near * dy, y1: Math.max(y1 + dy, y0 + near * dy) });
  }

  between([a, b], [c, d]) {
    return { x0: this.ix(Math.min(a, c)), x1: this.ix(Math.max(a, c)), y0: this.iy(Math.max(b, d)), y1: this.iy(Math.min(b, d)) };
  }

  destroy() { this.observer.disconnect(); }
}
