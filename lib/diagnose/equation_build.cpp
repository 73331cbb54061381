// SPDX-License-Identifier: Apache-2.0
// From prepared records to the equations of a model.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "diagnose/equation_build.hpp"
#include "diagnose/standstill.hpp"

namespace driveid::diagnose {
namespace {

double floor_low(const Equation &e, const Eigen::VectorXd &parameters, const std::vector<Source> &sources) {
  // noise of position through J w2 + B w1, of the input through w0
  double sum = 0, count = 0;
  for (const Track &t : e.tracks) {
    const Source &s = sources[std::size_t(t.record)];
    double a = parameters.size() > 0 ? parameters[0] : 0, b = parameters.size() > 1 ? parameters[1] : 0, variance = 0;
    const int n = 2 * t.kernel.half + 1;
    if (!e.electrical) {
      bool from_speed = s.roles.position.empty();
      double sigma = s.record->quality.at(from_speed ? s.roles.speed : s.roles.position).noise;
      for (int i = 0; i < n; ++i) {
        double w = from_speed ? a * t.kernel.w[1][std::size_t(i)] + b * t.kernel.w[0][std::size_t(i)] : a * t.kernel.w[2][std::size_t(i)] + b * t.kernel.w[1][std::size_t(i)];
        variance += sigma * sigma * w * w;
      }
      double q = s.record->quality.at(s.roles.input).quantum / std::sqrt(12.0) * e.gain;
      double nw = norm2(t.kernel.w[0]);
      variance += q * q * nw * nw;
    }
    sum += variance * double(t.row.size());
    count += double(t.row.size());
  }
  return count > 0 ? std::sqrt(sum / count) : 0;
}

// Mechanical balance: J accel + B speed + losses = gain * drive.
Equation mechanical(const driveid_model &model, const std::vector<Source> &sources, double gain, std::vector<Notice> &notices) {
  Equation e;
  const Roles &roles = sources[0].roles;
  bool linear = model.structure == DRIVEID_STRUCTURE_LINEAR_AXIS;
  e.signal = roles.effort_unit == "V" ? "voltage" : linear ? "force" : "torque";
  e.gain = gain;
  e.unit = gain != 1 && roles.per_ampere ? (linear ? "N" : "N m") : roles.effort_unit;
  e.frame = roles.effort_unit == "V" ? DRIVEID_FRAME_VOLT
            : e.unit == "A"          ? (linear ? DRIVEID_FRAME_AMPERE_LINEAR : DRIVEID_FRAME_AMPERE)
            : linear                 ? DRIVEID_FRAME_FORCE : DRIVEID_FRAME_TORQUE;
  e.drive_unit = roles.input == "v_V" ? 'V' : roles.input == "tau_Nm" || roles.input == "F_N" ? 'N' : 'A';
  if (!roles.position.empty()) {
    const SignalQuality &q = sources[0].record->quality.at(roles.position);
    e.quantum = std::max(q.quantum, 6 * q.noise);
  }
  e.input_noise = sources[0].record->quality.at(roles.input).noise;
  double width = choose_width(sources[0]);
  int step = row_step(sources, width), run = 0;
  for (int pass = 0; pass < 2; ++pass) {   // the second pass keeps rests where nearly nothing else is there
    e.tracks.clear();
    std::size_t possible = 0, kept = 0;
    for (const Source &s : sources) {
      double dt = s.record->dt_s;
      int half = std::max(3, int(std::lround(width / dt)));
      Kernel wide = make_kernel(half, dt), narrow = make_kernel(std::max(3, (2 * half) / 3), dt);
      for (const Piece &p : s.record->pieces) {
        if (int(p.n) < 6 * half + 10) continue;
        Track t;
        t.record = s.index;
        t.held_out = s.held_out;
        t.t0_s = p.t0_s;
        t.dt_s = dt;
        t.kernel = wide;
        Fine f = kinematics(s, p, dt, wide, narrow);
        t.position = f.position;
        t.speed_raw = f.raw_speed;
        t.drive_raw = p.signal.at(s.roles.input);
        t.rest = rests(f, s, dt, half);
        t.still = f.still;
        t.position_smooth = convolve_all(t.position, wide, 0);
        bool is_current = s.roles.input != "v_V" && s.roles.input != "tau_Nm" && s.roles.input != "F_N";
        fill_states(t, p, f, t.drive_raw, gain, 0, is_current ? t.drive_raw : std::vector<double>(), temperature_of(p), false, 0);
        place_rows(t, p, step, pass == 0, run);
        possible += p.n / std::size_t(step);
        kept += t.row.size();
        e.tracks.push_back(std::move(t));
      }
    }
    if (kept * 6 > possible && kept > 150) break;
  }
  finish(e);
  if (e.rows < 60) return e;
  bool from_speed = roles.position.empty();
  FineSignal motion = [from_speed](const Track &t, std::vector<double> &f) { f = from_speed ? t.speed_raw : t.position; };
  const char *inertia = "J_kgm2", *damping = "B_Nms_rad";
  if (model.structure == DRIVEID_STRUCTURE_TWO_MASS_AXIS) inertia = parameter(model, "J_m_kgm2") ? "J_m_kgm2" : "J_m_As2_rad";
  else if (linear) inertia = e.unit == "A" ? "m_As2_m" : "m_kg", damping = e.unit == "A" ? "b_As_m" : "b_Ns_m";
  else if (e.unit == "A") inertia = "J_As2_rad", damping = "B_As_rad";
  else if (e.unit == "V") inertia = "J_Vs2_rad", damping = "B_Vs_rad";
  add_base(e, model, inertia, motion, from_speed ? 1 : 2);
  add_base(e, model, damping, motion, from_speed ? 0 : 1);
  settle(e, sources[0], notices);
  hold_by_friction(e);
  return e;
}

double solve_for(const Equation &e, const char *name) {
  if (e.rows < 60 || e.base.cols() == 0) return 0;
  for (const BaseColumn &b : e.base_column)
    if (b.given && b.name == name) return b.value;
  Eigen::MatrixXd x(e.base.rows(), e.base.cols() + 1);
  x.leftCols(e.base.cols()) = e.base;
  x.col(e.base.cols()) = stack(e, [](const Track &t, std::vector<double> &f) { f.resize(t.state.size()); for (std::size_t k = 0; k < f.size(); ++k) f[k] = t.state[k].current_A > 0 ? 1 : -1; }, 0);
  Eigen::VectorXd p = x.colPivHouseholderQr().solve(e.y);
  int c = 0;
  for (const BaseColumn &b : e.base_column) {
    if (b.given) continue;
    if (b.name == name) return p[c];
    ++c;
  }
  return 0;
}

}  // namespace

EquationSet make_equations(const driveid_model &model, const std::vector<Prepared> &training, const std::vector<Prepared> &held_out) {
  EquationSet set;
  std::vector<Source> sources;
  for (const Prepared &p : training) sources.push_back({&p, int(sources.size()), false, roles_of(model, p)});
  for (const Prepared &p : held_out) sources.push_back({&p, int(sources.size()), true, roles_of(model, p)});
  for (const Source &s : sources)
    if (!s.record->bad.empty()) {
      set.bad = s.record->name + ": " + s.record->bad;
      return set;
    }
  auto all_have = [&](std::initializer_list<const char *> names) {
    for (const Source &s : sources)
      for (const char *n : names)
        if (!s.record->has(n)) return false;
    return true;
  };
  auto motion = [&] {
    for (const Source &s : sources)
      if (s.roles.position.empty() && s.roles.speed.empty()) return false;
    return true;
  };
  double gain = sources[0].roles.input_gain;
  const auto structure = model.structure;
  const bool circuit = structure == DRIVEID_STRUCTURE_DC_CIRCUIT, drive = structure == DRIVEID_STRUCTURE_DC_DRIVE, pmsm = structure == DRIVEID_STRUCTURE_PMSM_DRIVE;
  if ((circuit || drive) && all_have({"v_V", "i_A"})) {
    Equation e = dc_voltage(model, sources, set.notices);
    if (drive && sources[0].roles.per_ampere && e.rows >= 60) gain = std::max(1e-9, solve_for(e, "K_e_Vs_rad"));
    if (e.rows >= 60) set.equation.push_back(std::move(e));
  } else if (circuit) {
    set.bad = "dc_circuit needs the columns v_V and i_A (and speed or angle for K_e): record voltage and current";
    return set;
  }
  if (pmsm && all_have({"v_d_V", "v_q_V", "i_d_A", "i_q_A"}) && motion()) {
    Equation e = dq_voltage(model, sources, set.notices);
    const driveid_param *pp = parameter(model, "pole_pairs");
    if (sources[0].roles.per_ampere && e.rows >= 60 && pp && pp->state != DRIVEID_PARAM_UNSET) gain = std::max(1e-9, 1.5 * pp->value * solve_for(e, "psi_pm_Vs"));
    if (e.rows >= 60) set.equation.push_back(std::move(e));
  }
  if (!circuit && structure != DRIVEID_STRUCTURE_LTI) {
    bool ready = motion();
    for (const Source &s : sources) ready &= !s.roles.input.empty();
    if (ready) {
      for (const Source &s : sources)
        if (const std::string still = standstill(*s.record, s.roles); set.bad.empty() && !still.empty()) set.bad = s.record->name + ": " + still;
      if (set.bad.empty()) {
        Equation e = mechanical(model, sources, gain, set.notices);
        if (e.rows >= 60) set.equation.push_back(std::move(e));
        else if (set.equation.empty()) set.bad = "too little motion for an equation: record at least some seconds with accelerations in both directions";
      }
    } else if (set.equation.empty()) {
      bool linear = structure == DRIVEID_STRUCTURE_LINEAR_AXIS;
      set.bad = motion() ? (linear ? "no input column: record F_N, or i_A with K_F_N_A given" : "no input column: record i_A, i_q_A or tau_Nm")
                         : (linear ? "no motion column: record x_m or v_m_s" : "no motion column: record theta_rad or omega_rad_s");
    }
  }
  if (structure == DRIVEID_STRUCTURE_LTI && set.equation.empty() && set.bad.empty()) {
    if (!all_have({"u", "y"})) set.bad = "lti needs the columns u and y";
    else set.bad = "explain works on drive structures; use fit and compare for lti";
  }
  if (!set.bad.empty()) set.equation.clear();
  for (Equation &e : set.equation) {
    Eigen::VectorXd p = e.base.cols() ? Eigen::VectorXd(e.base.colPivHouseholderQr().solve(e.y)) : Eigen::VectorXd();
    e.floor_lo = floor_low(e, p, sources);
  }
  return set;
}

}  // namespace driveid::diagnose
