// SPDX-License-Identifier: Apache-2.0
// Page 4: what is missing, with the evidence; what cannot be told apart; a button adds the effect.

import * as api from "../api.js";
import { el, into } from "../dom.js";
import * as state from "../state.js";
import { ownEffect } from "./own.js";

/** An effect as often as it was found (cogging of two orders stands in the model twice). */
const times = (c) => Array(c.orders ?? 1).fill(c.effect);
const add = (effects) => state.go({ add: [...state.list("add"), ...effects].join(","), models: null }, "falls");

function card(c, base, signal, beside) {
  const question = { ...base, effect: c.effect, beside };
  const facts = [["explains", c.share], ["confidence", c.confidence]].filter(([, v]) => v);
  const evidence = el("div");
  const box = el("section.card.candidate", { "data-effect": c.effect },
    el("header", {}, el("h2", {}, c.title), c.accepted ? el("span.tag.warn", {}, "missing") : el("span.tag.soft", {}, "rejected"), el(c.accepted ? "button.primary" : "button", { onclick: () => add(times(c)) }, c.orders > 1 ? `Add its ${c.orders} orders` : "Add it")),
    el("div.meter", {}, el("i", { style: `width:${Math.max(0, parseFloat(c.share.replace("−", "-")) || 0)}%` })),
    el("div.facts", { html: facts.map(([k, v]) => `<span>${k} <b>${v}</b></span>`).join("") + (c.parameters ? `<span>${c.parameters}</span>` : "") }),
    c.equation ? el("p.soft", {}, el("code", {}, c.equation)) : null,
    c.why ? el("p.soft", {}, c.why) : null,
    c.ties.length ? el("p", {}, "Not told apart from ", ...c.ties.flatMap((t, k) => [k ? ", " : "", el("b", {}, t.title), " ", el("button", { onclick: () => add([t.name]) }, `Add ${t.title} instead`)]), ".") : null,
    evidence);
  if (c.accepted) into(evidence, signal, `drawing what ${c.title} says`, async (o) => el("div", { html: (await api.json("evidence", question, o)).html }));
  else evidence.append(el("details", { ontoggle: (e) => e.target.open && !e.target.dataset.asked && (e.target.dataset.asked = "1", into(e.target.lastChild, signal, "drawing", async (o) => el("div", { html: (await api.json("evidence", question, o)).html }))) }, el("summary", {}, "what it would explain"), el("div")));
  return box;
}

export function mount(place, { project, signal }) {
  const base = { p: project.id, add: state.get("add") };
  into(place, signal, "trying every effect of the catalogue", async (options) => {
    const a = await api.json("missing", base, options);
    const accepted = a.candidates.filter((c) => c.accepted), rest = a.candidates.filter((c) => !c.accepted);
    const nodes = [el("div", { html: a.html, "data-verdict": a.verdict })];
    if (a.verdict === "nothing_missing") nodes.push(el("div.row", {}, el("button.primary", { onclick: () => state.go({}, "falls") }, "See how the error fell, and export")));
    const cards = accepted.length ? el("div.candidates", {}, ...accepted.map((c) => card(c, base, signal, accepted.flatMap(times).join(",")))) : null;
    const aside = el("div", {}, a.shape ? el("section.card", { html: `<h2>The shape of what is unknown</h2>${a.shape}` }) : null, a.verdict === "unknown" ? ownEffect(project, base, true) : null,
      a.next ? el("section.card", { html: `<h2>The motion that would tell</h2>${a.next}` }) : null);
    if (cards && aside.childElementCount) nodes.push(el("div.split", {}, cards, aside));
    else nodes.push(...[cards, aside].filter(Boolean));
    if (rest.length) nodes.push(el("details", {}, el("summary", {}, `Looked at and rejected (${rest.length} nearest)`), el("div.candidates", { style: "margin-top:10px" }, ...rest.map((c) => card(c, base, signal, times(c).join(","))))));
    if (a.verdict !== "unknown") nodes.push(ownEffect(project, base, false));
    return nodes;
  });
  return {
    keys(e) { if (e.key === "a") place.querySelector(".candidate button.primary")?.click(); },
    destroy() {},
  };
}
