// SPDX-License-Identifier: Apache-2.0
// What is shown is what the address says: one page and its parameters. Everything else is derived.

const listeners = new Set();

export const page = () => location.pathname.replace(/^\//, "") || "compare";
export const params = () => new URLSearchParams(location.search);
export const get = (name, otherwise = "") => params().get(name) ?? otherwise;
export const list = (name) => get(name).split(",").filter(Boolean);

function address(to, changes) {
  const query = params();
  for (const [name, value] of Object.entries(changes)) {
    if (value === null || value === "" || value === undefined) query.delete(name);
    else query.set(name, value);
  }
  const text = query.toString().replaceAll("%2C", ",").replaceAll("%7C", "|").replaceAll("%3A", ":");
  return `/${to}${text ? `?${text}` : ""}`;
}

/** Go somewhere: a new entry of the history, drawn anew. */
export function go(changes = {}, to = page()) {
  history.pushState(null, "", address(to, changes));
  listeners.forEach((f) => f());
}

/** Remember a detail (zoom, selection) in the address without drawing anew. */
export function keep(changes) {
  history.replaceState(null, "", address(page(), changes));
}

export const link = (to, changes = {}) => address(to, changes);
export function onChange(f) { listeners.add(f); }
addEventListener("popstate", () => listeners.forEach((f) => f()));
