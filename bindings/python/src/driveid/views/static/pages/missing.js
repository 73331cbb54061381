// SPDX-License-Identifier: Apache-2.0
// Page 4: what is missing, with the evidence; what cannot be told apart; a button adds the effect.

import * as api from "../api.js";
import { el, into, toast } from "../dom.js";
import * as state from "../state.js";

export const add = (effect, title) => {
  const chain = state.list("add");
  if (chain.includes(effect)) return toast(`${title} is in the model already`);
  state.go({ add: [...chain, effect].join(","), models: null }, "falls");
};

function card(c, base, signal, beside) {
  const question = { ...base, effect: c.effect, beside };
  const facts = [["explains", c.share], ["confidence", c.confidence]].filter(([, v]) => v);
  const evidence = el("div");
  const box = el("section.card.candidate", { "data-effect": c.effect },
    el("header", {}, el("h2", {}, c.title), c.accepted ? el("span.tag.warn", {}, "missing") : el("span.tag.soft", {}, "rejected"), el(c.accepted ? "button.primary" : "button", { onclick: () => add(c.effect, c.title) }, "Add it")),
    el("div.meter", {}, el("i", { style: `width:${Math.max(0, parseFloat(c.share.replace("−", "-")) || 0)}%` })),
    el("div.facts", { html: facts.map(([k, v]) => `<span>${k} <b>${v}</b></span>`).join("") + (c.parameters ? `<span>${c.parameters}</span>` : "") }),
    c.equation ? el("p.soft", {}, el("code", {}, c.equation)) : null,
    c.why ? el("p.soft", {}, c.why) : null,
    c.ties.length ? el("p", {}, "Not told apart from ", ...c.ties.flatMap((t, k) => [k ? ", " : "", el("b", {}, t.title), " ", el("button", { onclick: () => add(t.name, t.title) }, `Add ${t.title} instead`)]), ".") : null,
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
    const cards = accepted.length ? el("div.candidates", {}, ...accepted.map((c) => card(c, base, signal, accepted.map((x) => x.effect).join(",")))) : null;
    const aside = el("div", {}, a.shape ? el("section.card", { html: `<h2>The shape of what is unknown</h2>${a.shape}` }) : null,
      a.next ? el("section.card", { html: `<h2>The motion that would tell</h2>${a.next}` }) : null);
    if (cards && aside.childElementCount) nodes.push(el("div.split", {}, cards, aside));
    else nodes.push(...[cards, aside].filter(Boolean));
    if (rest.length) nodes.push(el("details", {}, el("summary", {}, `Looked at and rejected (${rest.length} nearest)`), el("div.candidates", { style: "margin-top:10px" }, ...rest.map((c) => card(c, base, signal, "")))));
    return nodes;
  });
  return {
    keys(e) { if (e.key === "a") place.querySelector(".candidate button.primary")?.click(); },
    destroy() {},
  };
}
