// SPDX-License-Identifier: Apache-2.0
// An effect of one's own: name and formula, added to the model like one of the catalogue.

import * as api from "../api.js";
import { el } from "../dom.js";
import * as state from "../state.js";

const SIGNALS = { rotary: "theta_rad omega_rad_s alpha_rad_s2 i_A i_q_A tau_Nm v_V T_degC t_s", linear: "x_m v_m_s a_m_s2 F_N i_A v_V T_degC t_s" };

export function ownEffect(project, base, unknown) {
  const linear = project.structure === "linear axis";
  const mechanical = linear ? "F_N" : "tau_Nm", places = [[mechanical, linear ? "force that opposes the motion" : "torque that opposes the motion"], ["v_V", "voltage that is lost"]];
  const error = el("p.error", { role: "alert" });
  const input = (name, hint) => el("input", { id: `own-${name}`, name, placeholder: hint, spellcheck: "false", autocomplete: "off", required: true });
  const form = el("form.own", { onsubmit: async (e) => {
    e.preventDefault();
    error.textContent = "";
    try {
      const { element } = await api.json("own", { ...base, ...Object.fromEntries(new FormData(form)) });
      state.go({ add: [...state.list("add"), element].join(","), models: null }, "falls");
    } catch (problem) { error.textContent = problem.message; }
  } },
  el("label", { for: "own-name" }, "Name"), input("name", "my_drag"),
  el("label", { for: "own-formula" }, "Formula"), input("formula", linear ? "c * v_m_s * abs(v_m_s)" : "c * omega_rad_s * abs(omega_rad_s)"),
  el("label", { for: "own-adds_to" }, "It is a"), el("select", { id: "own-adds_to", name: "adds_to" }, ...places.map(([value, words]) => el("option", { value }, words))),
  error, el("p.soft.full", {}, "Signals: ", el("code", {}, linear ? SIGNALS.linear : SIGNALS.rotary), ". Every other name is a parameter that the fit finds. ",
    el("code", {}, "+ - * / ^ ( ) sin cos tan tanh exp log sqrt abs sign min max pow pi")),
  el("div.row.full", {}, el(unknown ? "button.primary" : "button", {}, "Add and fit")));
  return unknown ? el("section.card", {}, el("h2", {}, "An effect of your own"), el("p", {}, "You know the cause? Write it as a formula; the held-out error says whether it is right."), form)
    : el("details", {}, el("summary", {}, "An effect of your own"), el("section.card", { style: "margin-top:10px" }, form));
}
