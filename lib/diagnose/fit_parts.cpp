// SPDX-License-Identifier: Apache-2.0
// What a fit is made of: the frame its model is in, gap-free stretches, how inputs are read, and the parts that are fitted one after another.
#include "diagnose/fit_core.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace driveid::diagnose {

bool adopt_frame(driveid_model &model, const Prepared &record, std::string &reason) {
  if (model.structure == DRIVEID_STRUCTURE_LTI || model.structure == DRIVEID_STRUCTURE_DC_CIRCUIT || model.structure == DRIVEID_STRUCTURE_PMSM_DRIVE) return true;
  const Roles roles = roles_of(model, record);
  if (roles.input.empty()) return true;   // the equations refuse with what to record
  const bool linear = model.structure == DRIVEID_STRUCTURE_LINEAR_AXIS;
  driveid_frame frame = linear ? DRIVEID_FRAME_FORCE : DRIVEID_FRAME_TORQUE;
  if (roles.effort_unit == "V") frame = DRIVEID_FRAME_VOLT;
  else if (roles.per_ampere && !(model.structure == DRIVEID_STRUCTURE_DC_DRIVE && record.has("v_V"))) frame = linear ? DRIVEID_FRAME_AMPERE_LINEAR : DRIVEID_FRAME_AMPERE;
  char text[256] = "";
  if (driveid_model_set_frame(&model, frame, text, sizeof text) == DRIVEID_OK) return true;
  reason = text;
  return false;
}

namespace {

// Derivative of the cubic through nine samples: straight lines over as many would take the fast part of the speed, and with it a part of the
// back-EMF, for resistance.
std::vector<double> slope(const std::vector<double> &x, double dt) {
  static const double weight[4] = {126, 193, 142, -86};
  const std::ptrdiff_t n = std::ptrdiff_t(x.size()), h = 4;
  std::vector<double> v(x.size(), 0.0);
  for (std::ptrdiff_t k = h; k + h < n; k++)
    for (std::ptrdiff_t j = 1; j <= h; j++) v[std::size_t(k)] += weight[j - 1] * (x[std::size_t(k + j)] - x[std::size_t(k - j)]) / (1188 * dt);
  for (std::ptrdiff_t k = 0; k < n && n > 2 * h; k++) v[std::size_t(k)] = v[std::size_t(std::clamp(k, h, n - 1 - h))];
  return v;
}

}  // namespace

std::vector<batch::Stretch> make_stretches(const driveid_model &model, const Prepared &record, const Timing &timing) {
  const bool linear = model.structure == DRIVEID_STRUCTURE_LINEAR_AXIS;
  const Roles roles = roles_of(model, record);
  const driveid_signal position = linear ? DRIVEID_SIGNAL_X_M : DRIVEID_SIGNAL_THETA_RAD, speed = linear ? DRIVEID_SIGNAL_V_M_S : DRIVEID_SIGNAL_OMEGA_RAD_S;
  std::vector<batch::Stretch> out;
  for (const Piece &piece : record.pieces) {
    if (piece.n < 40) continue;
    batch::Stretch s;
    s.hold = timing.hold;
    s.skew_s = timing.skew_s;
    s.t_s.resize(piece.n);
    for (std::size_t k = 0; k < piece.n; k++) s.t_s[k] = piece.t0_s + double(k) * record.dt_s;
    for (const auto &[name, values] : piece.signal) {
      driveid_signal which;
      if (driveid_signal_from_name(name.c_str(), &which)) continue;
      s.column[which] = values;
      const auto q = record.quality.find(name);
      if (q != record.quality.end()) s.noise[which] = q->second.noise;
    }
    if (s.column[position].empty() && piece.signal.count(roles.position)) s.column[position] = piece.signal.at(roles.position);
    if (s.column[speed].empty() && piece.signal.count(roles.speed)) s.column[speed] = piece.signal.at(roles.speed);
    if (!s.column[position].empty()) s.column[speed] = slope(s.column[position], record.dt_s);   // the angle is the better witness
    out.push_back(std::move(s));
  }
  return out;
}

Timing timing_of(const std::vector<const Equation *> &equations, const Prepared &record, driveid_sim_mode mode) {
  if (record.hold == "average") return {DRIVEID_HOLD_AVERAGE, 0, true};
  if (record.hold == "zoh") return {DRIVEID_HOLD_ZERO, 0, true};
  if (record.hold == "instant") return {DRIVEID_HOLD_FIRST, 0, true};
  const Equation *chosen = nullptr;
  for (const Equation *e : equations)
    if (!chosen || e->electrical == (mode != DRIVEID_SIM_MECHANICAL)) chosen = e;   // voltage drives the circuit, current the axis
  if (!chosen || !(record.dt_s > 0)) return {};
  const double shift = chosen->input_shift_s, half = 0.5 * record.dt_s;
  if (shift > 0.5 * half) return {DRIVEID_HOLD_ZERO, shift - half, false};
  if (shift < -0.5 * half) return {DRIVEID_HOLD_AVERAGE, shift + half, false};
  return {DRIVEID_HOLD_FIRST, shift, false};
}

Timing timing_of(const EquationSet &set, const Prepared &record, driveid_sim_mode mode) {
  std::vector<const Equation *> equations;
  for (const Equation &e : set.equation) equations.push_back(&e);
  return timing_of(equations, record, mode);
}

std::vector<Part> parts_of(const driveid_model &model, const Prepared &record) {
  std::vector<Part> parts;
  const bool dq = model.structure == DRIVEID_STRUCTURE_PMSM_DRIVE, linear = model.structure == DRIVEID_STRUCTURE_LINEAR_AXIS;
  if (model.structure == DRIVEID_STRUCTURE_LTI) return {{DRIVEID_SIM_WHOLE, {DRIVEID_SIGNAL_Y}}};
  if (dq && record.has("v_d_V") && record.has("v_q_V") && record.has("i_d_A") && record.has("i_q_A")) parts.push_back({DRIVEID_SIM_ELECTRICAL, {DRIVEID_SIGNAL_I_D_A, DRIVEID_SIGNAL_I_Q_A}});
  const bool dc = model.structure == DRIVEID_STRUCTURE_DC_CIRCUIT || model.structure == DRIVEID_STRUCTURE_DC_DRIVE;
  if (dc && record.has("v_V") && record.has("i_A")) parts.push_back({DRIVEID_SIM_ELECTRICAL, {DRIVEID_SIGNAL_I_A}});
  if (model.structure == DRIVEID_STRUCTURE_DC_CIRCUIT) return parts;
  const Roles roles = roles_of(model, record);
  if (roles.input.empty() || (roles.position.empty() && roles.speed.empty())) return parts;
  const driveid_signal position = linear ? DRIVEID_SIGNAL_X_M : DRIVEID_SIGNAL_THETA_RAD, speed = linear ? DRIVEID_SIGNAL_V_M_S : DRIVEID_SIGNAL_OMEGA_RAD_S;
  std::vector<driveid_signal> outputs{roles.position.empty() ? speed : position};
  if (model.structure == DRIVEID_STRUCTURE_TWO_MASS_AXIS && record.has("theta_l_rad")) outputs.push_back(DRIVEID_SIGNAL_THETA_L_RAD);
  parts.push_back({DRIVEID_SIM_MECHANICAL, outputs});
  if (parts.size() > 1 && whole_mode(model, record) == DRIVEID_SIM_WHOLE) parts[0].judged_mode = DRIVEID_SIM_WHOLE, parts[0].judged_outputs = {outputs[0]};
  return parts;
}

driveid_sim_mode whole_mode(const driveid_model &model, const Prepared &record) {
  switch (model.structure) {
    case DRIVEID_STRUCTURE_DC_CIRCUIT: return DRIVEID_SIM_ELECTRICAL;
    case DRIVEID_STRUCTURE_LTI: return DRIVEID_SIM_WHOLE;
    case DRIVEID_STRUCTURE_DC_DRIVE: return record.has("i_A") && record.has("v_V") ? DRIVEID_SIM_WHOLE : DRIVEID_SIM_MECHANICAL;
    case DRIVEID_STRUCTURE_PMSM_DRIVE: return record.has("v_d_V") && record.has("v_q_V") ? DRIVEID_SIM_WHOLE : DRIVEID_SIM_MECHANICAL;
    default: return DRIVEID_SIM_MECHANICAL;
  }
}

driveid_signal scored_signal(const driveid_model &model, const Prepared &record) {
  const std::vector<Part> parts = parts_of(model, record);
  return parts.empty() ? DRIVEID_SIGNAL_COUNT : parts.back().outputs[0];
}

}  // namespace driveid::diagnose
