// SPDX-License-Identifier: Apache-2.0
// SI prefixes for axes and read-outs (the same rules as views/units.py).

const PREFIX = { "-12": "p", "-9": "n", "-6": "µ", "-3": "m", 0: "", 3: "k", 6: "M", 9: "G" };
const BOTH = ["Ω", "A", "V", "H", "Hz", "N", "W", "F", "s", "m"];
const SMALL = ["rad", "s", "m", "°C", ""];

export function scaleOf(size, unit) {
  if (!(size > 0) || !Number.isFinite(size)) return [1, unit];
  let power = 3 * Math.floor(Math.log10(size * 1.0000001) / 3);
  const lead = (unit.match(/^[^·/²³]*(?=[·/]|$)/) || [""])[0];
  if (power > 0 && SMALL.includes(lead) && size < 1e5) power = 0;
  if (power === 0 || (!unit && power < 0 && size >= 1e-2)) return [1, unit];
  if ((BOTH.includes(lead) || lead === "rad") && power in PREFIX) return [10 ** power, PREFIX[power] + unit];
  return [10 ** power, `e${power} ${unit}`.trim()];
}

export function format(value, unit, digits = 4) {
  if (!Number.isFinite(value)) return "–";
  const [divisor, text] = scaleOf(Math.abs(value), unit);
  return `${Number((value / divisor).toPrecision(digits))} ${text}`.trim().replace("-", "−");
}

export const seconds = (s) => (s < 120 ? format(s, "s", 4) : `${Math.floor(s / 60)} min ${Math.round(s % 60)} s`);
