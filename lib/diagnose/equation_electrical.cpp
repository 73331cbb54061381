// SPDX-License-Identifier: Apache-2.0
// Voltage balances: of a DC winding, and of a synchronous machine in dq.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "diagnose/equation_build.hpp"

namespace driveid::diagnose {
namespace {

void note_current(Equation &e) {
  e.current = stack(e, [](const Track &t, std::vector<double> &f) { f = t.current_raw; }, 0);
  e.current_smooth = stack(e, [](const Track &t, std::vector<double> &f) {
    f.resize(t.state.size());
    for (std::size_t k = 0; k < f.size(); ++k) f[k] = t.state[k].current_A;
  }, 0);
}

}  // namespace

// Voltage balance of a DC winding: L di/dt + R i + K_e omega + losses = v.
Equation dc_voltage(const driveid_model &model, const std::vector<Source> &sources, std::vector<Notice> &notices) {
  Equation e;
  e.signal = "voltage";
  e.unit = "V";
  e.electrical = true;
  e.drive_unit = 'V';
  const double dt0 = sources[0].record->dt_s, width = std::max(5 * dt0, 0.012);
  int step = row_step(sources, width), run = 0;
  for (const Source &s : sources) {
    double dt = s.record->dt_s;
    int half = std::max(4, int(std::lround(width / dt)));
    Kernel k = make_kernel(half, dt);
    double speed_width = s.roles.position.empty() && s.roles.speed.empty() ? width : choose_width(s);
    Kernel motion_kernel = make_kernel(std::max(3, int(std::lround(speed_width / dt))), dt);
    for (const Piece &p : s.record->pieces) {
      if (int(p.n) < 6 * half + 10) continue;
      Track t;
      t.record = s.index;
      t.held_out = s.held_out;
      t.t0_s = p.t0_s;
      t.dt_s = dt;
      t.kernel = k;
      Fine f;
      if (!s.roles.position.empty() || !s.roles.speed.empty()) f = kinematics(s, p, dt, motion_kernel, motion_kernel);
      t.position = f.position;
      t.speed_raw = f.raw_speed;
      t.drive_raw = p.signal.at("v_V");
      t.rest.assign(p.n, 0);
      t.current_raw = p.signal.at("i_A");
      fill_states(t, p, f, t.drive_raw, 1, 0, convolve_all(t.current_raw, make_kernel(std::max(2, half / 2), dt), 0), temperature_of(p), true, 1);
      place_rows(t, p, step, false, run);
      e.tracks.push_back(std::move(t));
    }
  }
  finish(e);
  if (e.rows < 60) return e;
  FineSignal current = [](const Track &t, std::vector<double> &f) { f = t.current_raw; };
  note_current(e);
  add_base(e, model, "R_ohm", current, 0);
  add_base(e, model, "L_H", current, 1);
  if (!e.tracks[0].position.empty()) {
    bool from_speed = !e.tracks[0].speed_raw.empty();
    add_base(e, model, "K_e_Vs_rad", [from_speed](const Track &t, std::vector<double> &f) { f = from_speed ? t.speed_raw : t.position; }, from_speed ? 0 : 1);
  }
  settle(e, sources[0], notices);
  return e;
}

// dq voltages stacked: rows of d, then rows of q, one set of columns.
Equation dq_voltage(const driveid_model &model, const std::vector<Source> &sources, std::vector<Notice> &notices) {
  Equation e;
  e.signal = "voltage";
  e.unit = "V";
  e.electrical = true;
  e.drive_unit = 'V';
  const driveid_param *pp = parameter(model, "pole_pairs");
  const double pairs = pp && pp->state != DRIVEID_PARAM_UNSET ? pp->value : 1;
  const double dt0 = sources[0].record->dt_s, width = std::max(5 * dt0, 0.012);
  int step = 2 * row_step(sources, width), run = 0;
  std::vector<std::vector<double>> id, iq, we;   // by track
  for (int part = 0; part < 2; ++part)
    for (const Source &s : sources) {
      double dt = s.record->dt_s;
      int half = std::max(4, int(std::lround(width / dt)));
      Kernel k = make_kernel(half, dt), motion_kernel = make_kernel(std::max(3, int(std::lround(choose_width(s) / dt))), dt);
      for (const Piece &p : s.record->pieces) {
        if (int(p.n) < 6 * half + 10) continue;
        Track t;
        t.record = s.index;
        t.held_out = s.held_out;
        t.part = part;
        t.t0_s = p.t0_s;
        t.dt_s = dt;
        t.kernel = k;
        Fine f = kinematics(s, p, dt, motion_kernel, motion_kernel);
        t.position = f.position;
        t.speed_raw = f.raw_speed;
        t.drive_raw = p.signal.at(part ? "v_q_V" : "v_d_V");
        t.rest.assign(p.n, 0);
        t.current_raw = p.signal.at(part ? "i_q_A" : "i_d_A");
        fill_states(t, p, f, t.drive_raw, 1, 0, convolve_all(t.current_raw, make_kernel(std::max(2, half / 2), dt), 0), temperature_of(p), true, 1);
        place_rows(t, p, step, false, run);
        id.push_back(p.signal.at("i_d_A"));
        iq.push_back(p.signal.at("i_q_A"));
        we.push_back(f.speed);
        for (double &w : we.back()) w *= pairs;
        e.tracks.push_back(std::move(t));
      }
    }
  finish(e);
  if (e.rows < 60) return e;
  auto index = [&](const Track &t) { return std::size_t(&t - e.tracks.data()); };
  note_current(e);
  FineSignal resistance = [&](const Track &t, std::vector<double> &f) { f = t.part ? iq[index(t)] : id[index(t)]; };
  add_base(e, model, "R_ohm", resistance, 0);
  // L_d: d rows L_d did/dt, q rows + w L_d i_d; L_q: d rows - w L_q i_q, q rows L_q diq/dt
  auto product = [](const std::vector<double> &a, const std::vector<double> &b, double sign) { std::vector<double> c(a.size()); for (std::size_t k = 0; k < c.size(); ++k) c[k] = sign * a[k] * b[k]; return c; };
  auto mixed = [&](bool of_d) {
    Eigen::VectorXd out{Eigen::Index(e.rows)};
    for (const Track &t : e.tracks) {
      std::size_t j = index(t);
      bool derivative = (t.part == 0) == of_d;
      std::vector<double> fine = derivative ? (of_d ? id[j] : iq[j]) : product(we[j], of_d ? id[j] : iq[j], of_d ? 1 : -1);
      apply_kernel(t, fine, derivative ? 1 : 0, out.data() + t.first);
    }
    return out;
  };
  add_column(e, model, "L_d_H", mixed(true));
  add_column(e, model, "L_q_H", mixed(false));
  FineSignal emf = [&](const Track &t, std::vector<double> &f) { f = we[index(t)]; if (!t.part) std::fill(f.begin(), f.end(), 0.0); };
  add_base(e, model, "psi_pm_Vs", emf, 0);
  settle(e, sources[0], notices);
  return e;
}

}  // namespace driveid::diagnose
