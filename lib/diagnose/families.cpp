// SPDX-License-Identifier: Apache-2.0
// General regressors that name no physics: what any model could take out of an equation's error.
#include <algorithm>
#include <cmath>
#include <optional>

#include "diagnose/floor.hpp"

namespace driveid::diagnose {
namespace {

std::vector<double> sample(const Equation &e, const std::function<double(const driveid_effect_state &)> &of) {
  std::vector<double> v;
  std::size_t total = 0;
  for (const Track &t : e.tracks) total += t.row.size();
  std::size_t step = std::max<std::size_t>(1, total / 5000);
  for (const Track &t : e.tracks)
    for (std::size_t r = 0; r < t.row.size(); r += step) v.push_back(of(t.state[std::size_t(t.row[r])]));
  std::sort(v.begin(), v.end());
  return v;
}

// Knots half by quantile, half by range, so that neither rare nor frequent values are left coarse.
std::vector<double> knots(const Equation &e, const std::function<double(const driveid_effect_state &)> &of, int count, double least = 0) {
  std::vector<double> v = sample(e, of), k;
  if (v.size() < 10 || v.back() - v.front() < 1e-12) return k;
  for (int j = 0; j < count; ++j) {
    double q = double(j) / (count - 1), quantile = v[std::size_t(q * double(v.size() - 1))], range = v.front() + q * (v.back() - v.front());
    k.push_back(0.5 * (quantile + range));
  }
  std::sort(k.begin(), k.end());
  std::vector<double> out;
  for (double x : k)
    if (out.empty() || x - out.back() > std::max(least, 1e-3 * (k.back() - k.front()))) out.push_back(x);
  return out;
}

double hat(const std::vector<double> &k, std::size_t j, double x) {
  if (x <= k.front()) return j == 0;
  if (x >= k.back()) return j + 1 == k.size();
  if (j > 0 && x > k[j - 1] && x <= k[j]) return (x - k[j - 1]) / (k[j] - k[j - 1]);
  if (j + 1 < k.size() && x > k[j] && x < k[j + 1]) return (k[j + 1] - x) / (k[j + 1] - k[j]);
  return 0;
}

using Value = std::function<double(const driveid_effect_state &)>;

Eigen::VectorXd one_column(const Equation &e, const Value &value) {
  return stack(e, [&](const Track &t, std::vector<double> &f) {
    f.resize(t.state.size());
    for (std::size_t k = 0; k < f.size(); ++k) f[k] = value(t.state[k]);
  }, 0);
}

// factor times a hat over the coordinate at each knot, or only at those of `kept`.
Eigen::MatrixXd product_columns(const Equation &e, const Value &factor, const Value &coordinate, const std::vector<double> &k, const std::optional<std::vector<double>> &kept = {}) {
  Eigen::MatrixXd m(Eigen::Index(e.rows), Eigen::Index(kept ? kept->size() : k.size()));
  Eigen::Index at = 0;
  for (std::size_t j = 0; j < k.size(); ++j)
    if (!kept || std::find(kept->begin(), kept->end(), k[j]) != kept->end()) m.col(at++) = one_column(e, [&](const driveid_effect_state &s) { double h = hat(k, j, coordinate(s)); return h == 0 ? 0.0 : h * factor(s); });
  return m;
}

Eigen::MatrixXd no_drive(const Equation &e, Eigen::MatrixXd m) {
  for (Eigen::Index k = 0; k < m.cols(); ++k) remove_drive(e, m.col(k));
  return m;
}

Eigen::MatrixXd beside(const Eigen::MatrixXd &a, const Eigen::MatrixXd &b) {
  Eigen::MatrixXd m(std::max(a.rows(), b.rows()), a.cols() + b.cols());
  if (a.cols()) m.leftCols(a.cols()) = a;
  if (b.cols()) m.rightCols(b.cols()) = b;
  return m;
}

Eigen::MatrixXd harmonics(const Equation &e, const Value &factor, int from, int to) {
  Eigen::MatrixXd m(Eigen::Index(e.rows), 2 * (to - from + 1));
  for (int n = from; n <= to; ++n) {
    m.col(2 * (n - from)) = one_column(e, [&](const driveid_effect_state &s) { return factor(s) * std::sin(n * s.angle); });
    m.col(2 * (n - from) + 1) = one_column(e, [&](const driveid_effect_state &s) { return factor(s) * std::cos(n * s.angle); });
  }
  return m;
}

// Rows of the acceleration, smoothed once like the nominal inertia's, times hats of a coordinate: a second smoothing would
// let the family gain by filtering the position's noise rather than by explaining anything.
Eigen::MatrixXd accel_columns(const Equation &e, const Value &coordinate, const std::vector<double> &k, int from = 0, int to = -1) {
  const bool from_speed = !e.tracks[0].speed_raw.empty();
  Eigen::VectorXd accel = stack(e, [from_speed](const Track &t, std::vector<double> &f) { f = from_speed ? t.speed_raw : t.position; }, from_speed ? 1 : 2);
  Eigen::Index columns = to >= from ? 2 * (to - from + 1) : Eigen::Index(k.size());
  Eigen::MatrixXd m(Eigen::Index(e.rows), columns);
  for (const Track &t : e.tracks)
    for (std::size_t r = 0; r < t.row.size(); ++r) {
      const driveid_effect_state &s = t.state[std::size_t(t.row[r])];
      const auto row = Eigen::Index(t.first + r);
      if (to >= from)
        for (int n = from; n <= to; ++n) m(row, 2 * (n - from)) = accel[row] * std::sin(n * s.angle), m(row, 2 * (n - from) + 1) = accel[row] * std::cos(n * s.angle);
      else
        for (std::size_t j = 0; j < k.size(); ++j) m(row, Eigen::Index(j)) = accel[row] * hat(k, j, coordinate(s));
    }
  return m;
}

// Inertia that varies over the turn, in the weak form: cos(n q) q'' = (sin(n q))''/n + n sin(n q) q'^2, exact however fast the turn.
Eigen::MatrixXd weak_inertia(const Equation &e, int from, int to) {
  Eigen::MatrixXd m(Eigen::Index(e.rows), 4 * (to - from + 1));
  for (int n = from; n <= to; ++n)
    for (int q = 0; q < 2; ++q) {
      auto wave = [n, q](double angle) { return q ? std::cos(n * angle) : std::sin(n * angle); };
      m.col(4 * (n - from) + 2 * q) = stack(e, [&](const Track &t, std::vector<double> &f) {
        f.resize(t.position.size());
        for (std::size_t k = 0; k < f.size(); ++k) f[k] = wave(t.position[k]);
      }, 2);
      m.col(4 * (n - from) + 2 * q + 1) = one_column(e, [&](const driveid_effect_state &s) { return s.speed * s.speed * wave(s.angle); });
    }
  return m;
}

Eigen::MatrixXd turn_over_time(const Equation &e, const Value &factor, const std::vector<double> &kt) {
  Value time = [](const driveid_effect_state &s) { return s.t_s; };
  return beside(product_columns(e, [&](const driveid_effect_state &s) { return factor(s) * std::sin(s.angle); }, time, kt),
                product_columns(e, [&](const driveid_effect_state &s) { return factor(s) * std::cos(s.angle); }, time, kt));
}

Eigen::MatrixXd memories(const Equation &e, double range) {
  static const double travel[] = {1e-4, 1e-3, 1e-2, 0.05, 0.2};
  const driveid_effect_info *dahl = driveid_effect_find("hysteresis");
  Eigen::MatrixXd m(Eigen::Index(e.rows), 5);
  for (int j = 0; j < 5; ++j) {
    double shape[1] = {std::max(travel[j] * range, 4 * e.quantum)};
    m.col(j) = effect_columns(e, *dahl, shape).col(0);
  }
  return m;
}

// What inertia, damping, direction and a constant leave of the drive: an upper bound of the drive's noise. Knots closer than some of
// these would let a family of the drive explain that noise by itself.
double spread_of_rest(const Equation &e) {
  Eigen::MatrixXd x(Eigen::Index(e.rows), e.base.cols() + 2);
  x.leftCols(e.base.cols()) = e.base;
  x.col(e.base.cols()) = one_column(e, [](const driveid_effect_state &s) { return s.direction; });
  x.col(e.base.cols() + 1).setOnes();
  Eigen::VectorXd scale = (x.colwise().norm().array() + 1e-300).matrix().transpose().cwiseInverse();
  Eigen::MatrixXd q = x * scale.asDiagonal(), g = q.transpose() * q;
  g.diagonal().array() += 1e-10;
  Eigen::VectorXd r = e.y - q * g.ldlt().solve(q.transpose() * e.y);
  return std::sqrt(r.squaredNorm() / double(e.rows));
}

void mechanical_families(const Equation &e, std::vector<Family> &out) {
  Value one = [](const driveid_effect_state &) { return 1.0; }, direction = [](const driveid_effect_state &s) { return s.direction; };
  Value speed = [](const driveid_effect_state &s) { return s.speed; };
  Value position = [](const driveid_effect_state &s) { return s.angle; }, drive = [](const driveid_effect_state &s) { return s.torque; };
  Value time = [](const driveid_effect_state &s) { return s.t_s; }, temperature = [](const driveid_effect_state &s) { return s.T_degC; };
  const bool rotary = e.frame != DRIVEID_FRAME_FORCE && e.frame != DRIVEID_FRAME_AMPERE_LINEAR;
  const bool warm = e.tracks[0].state[0].has_temperature;
  const std::string w = rotary ? "omega_rad_s" : "v_m_s", x = rotary ? "theta_rad" : "x_m", i = e.drive_unit == 'V' ? "v_V" : e.drive_unit == 'N' ? (rotary ? "tau_Nm" : "F_N") : "i_A";
  auto add = [&](const char *name, std::vector<std::string> coordinates, std::vector<std::string> catalogue, Eigen::MatrixXd column) {
    if (column.cols()) out.push_back({name, std::move(coordinates), std::move(catalogue), std::move(column)});
  };
  std::vector<double> kw = knots(e, speed, 11), kabs = knots(e, [](const driveid_effect_state &s) { return std::fabs(s.speed); }, 8);
  std::vector<double> kx = knots(e, position, 22), kx8 = knots(e, position, 9), ki = knots(e, drive, 9, 5 * spread_of_rest(e)), kt = knots(e, time, 7);
  double range = kx.empty() ? 1 : kx.back() - kx.front();
  add("speed", {w}, {"coulomb", "stribeck", "quadratic_drag", "constant_load", "asymmetric_friction", "current_offset"},
      beside(one_column(e, one), beside(product_columns(e, one, speed, kw), product_columns(e, direction, [](const driveid_effect_state &s) { return std::fabs(s.speed); }, kabs))));
  add("position", {x}, {"gravity_unbalance", "cogging", "constant_load"}, product_columns(e, one, position, kx));
  if (rotary) add("turn", {x}, {"gravity_unbalance", "cogging"}, harmonics(e, one, 1, 8));
  // A gain of its own within the drive's noise would only take that noise back where the axis rests.
  std::vector<double> beyond_noise;
  for (double k : ki)
    if (std::fabs(k) > 5 * e.gain * e.input_noise) beyond_noise.push_back(k);
  add("drive", {i}, {"torque_saturation", "dead_zone"}, no_drive(e, product_columns(e, drive, drive, ki, beyond_noise)));
  add("direction_position", {"direction", x}, {"eccentric_friction"}, beside(product_columns(e, direction, position, kx8), rotary ? harmonics(e, direction, 1, 4) : Eigen::MatrixXd(Eigen::Index(e.rows), 0)));
  add("damping_position", {w, x}, {}, product_columns(e, speed, position, kx8));
  add("inertia_position", {"acceleration", x}, {}, beside(accel_columns(e, position, kx8), rotary ? accel_columns(e, position, {}, 1, 4) : Eigen::MatrixXd(Eigen::Index(e.rows), 0)));
  if (rotary) add("inertia_turn", {"acceleration", x}, {}, weak_inertia(e, 1, 4));
  if (rotary) add("friction_turn_time", {"direction", x, "t_s"}, {}, turn_over_time(e, direction, kt));
  add("drive_position", {i, x}, {"torque_ripple"}, no_drive(e, beside(product_columns(e, drive, position, kx8), rotary ? harmonics(e, drive, 1, 8) : Eigen::MatrixXd(Eigen::Index(e.rows), 0))));
  add("drive_speed", {i, w}, {"load_dependent_friction"}, no_drive(e, beside(product_columns(e, drive, speed, kw), one_column(e, [](const driveid_effect_state &s) { return std::fabs(s.torque) * s.direction; }))));
  add("turn_speed", {x, w}, {"encoder_eccentricity"}, rotary ? beside(harmonics(e, [](const driveid_effect_state &s) { return s.speed * s.speed; }, 1, 2), harmonics(e, speed, 1, 4)) : Eigen::MatrixXd(Eigen::Index(e.rows), 0));
  add("friction_time", {"direction", "t_s"}, {"friction_drift"}, beside(product_columns(e, direction, time, kt), product_columns(e, speed, time, kt)));
  add("inertia_time", {"acceleration", "t_s"}, {"inertia_change"}, accel_columns(e, time, knots(e, time, 12)));
  add("memory", {"travel since reversal"}, {"hysteresis", "lugre", "backlash"}, memories(e, range));
  if (warm) {
    std::vector<double> kT = knots(e, temperature, 5);
    add("temperature", {"T_degC"}, {"friction_drift"}, beside(product_columns(e, one, temperature, kT), beside(product_columns(e, direction, temperature, kT), product_columns(e, speed, temperature, kT))));
    if (!kT.empty()) {
      double T0 = kT[kT.size() / 2];
      add("temperature_position", {"T_degC", x}, {}, beside(product_columns(e, [T0](const driveid_effect_state &s) { return (s.T_degC - T0) * s.direction; }, position, kx8),
          rotary ? harmonics(e, [T0](const driveid_effect_state &s) { return (s.T_degC - T0) * s.direction; }, 1, 3) : Eigen::MatrixXd(Eigen::Index(e.rows), 0)));
    }
  }
}

void electrical_families(const Equation &e, std::vector<Family> &out) {
  Value one = [](const driveid_effect_state &) { return 1.0; }, current = [](const driveid_effect_state &s) { return s.current_A; };
  Value sign = [](const driveid_effect_state &s) { return double((s.current_A > 0) - (s.current_A < 0)); };
  Value speed = [](const driveid_effect_state &s) { return s.speed; }, time = [](const driveid_effect_state &s) { return s.t_s; };
  Value heated = [](const driveid_effect_state &s) { return s.has_temperature ? s.T_degC * s.current_A : 0; };
  auto add = [&](const char *name, std::vector<std::string> coordinates, std::vector<std::string> catalogue, Eigen::MatrixXd column) {
    if (column.cols() == 0) return;
    same_current(e, column);
    out.push_back({name, std::move(coordinates), std::move(catalogue), std::move(column)});
  };
  std::vector<double> ki = knots(e, current, 11), kw = knots(e, speed, 9), kt = knots(e, time, 7);
  add("current", {"i_A"}, {"dead_time_voltage", "current_offset"}, beside(beside(one_column(e, one), one_column(e, sign)), product_columns(e, one, current, ki)));
  add("speed", {"omega_rad_s"}, {}, product_columns(e, one, speed, kw));
  add("resistance_time", {"i_A", "t_s"}, {"resistance_drift"}, product_columns(e, current, time, kt));
  add("emf_time", {"omega_rad_s", "t_s"}, {}, product_columns(e, speed, time, kt));
  add("current_speed", {"i_A", "omega_rad_s"}, {}, product_columns(e, current, speed, kw));
  if (e.tracks[0].state[0].has_temperature) add("resistance_temperature", {"i_A", "T_degC"}, {"resistance_drift"}, one_column(e, heated));
  add("turn", {"theta_rad"}, {}, harmonics(e, one, 1, 3));
}

}  // namespace

Family order_family(const Equation &e, double order) {
  const bool rotary = e.frame != DRIVEID_FRAME_FORCE && e.frame != DRIVEID_FRAME_AMPERE_LINEAR;
  Value speed = [](const driveid_effect_state &s) { return s.speed; };
  const std::vector<double> k = knots(e, speed, 12);
  Family f{"order_speed", {rotary ? "theta_rad" : "x_m", rotary ? "omega_rad_s" : "v_m_s"}, {}, {}};
  if (k.empty()) return f;
  f.column = beside(product_columns(e, [order](const driveid_effect_state &s) { return std::sin(order * s.angle); }, speed, k),
                    product_columns(e, [order](const driveid_effect_state &s) { return std::cos(order * s.angle); }, speed, k));
  return f;
}

std::vector<Family> make_families(const Equation &e) {
  std::vector<Family> out;
  if (e.electrical) electrical_families(e, out);
  else mechanical_families(e, out);
  return out;
}

}  // namespace driveid::diagnose
