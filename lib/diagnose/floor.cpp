// SPDX-License-Identifier: Apache-2.0
#include "diagnose/floor.hpp"

#include <algorithm>
#include <cmath>

namespace driveid::diagnose {
namespace {

constexpr double kTwoPi = 6.283185307179586;
constexpr int kArOrder = 6;

struct Axis {           // a coordinate at the fine grid, with knots at its quantiles
  std::function<double(const driveid_effect_state &)> of;
  std::vector<double> knot;
};

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

Eigen::MatrixXd product_columns(const Equation &e, const Value &factor, const Value &coordinate, const std::vector<double> &k) {
  Eigen::MatrixXd m(Eigen::Index(e.rows), Eigen::Index(k.size()));
  for (std::size_t j = 0; j < k.size(); ++j)
    m.col(Eigen::Index(j)) = one_column(e, [&](const driveid_effect_state &s) { double h = hat(k, j, coordinate(s)); return h == 0 ? 0.0 : h * factor(s); });
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
  add("drive", {i}, {"torque_saturation", "dead_zone"}, no_drive(e, product_columns(e, drive, drive, ki)));
  add("inertia_drive", {"acceleration", i}, {"torque_saturation"}, accel_columns(e, [](const driveid_effect_state &s) { return std::fabs(s.drive); }, knots(e, [](const driveid_effect_state &s) { return std::fabs(s.drive); }, 6, 5 * spread_of_rest(e) / std::max(1e-300, e.gain))));
  add("direction_position", {"direction", x}, {"eccentric_friction"}, beside(product_columns(e, direction, position, kx8), rotary ? harmonics(e, direction, 1, 4) : Eigen::MatrixXd(Eigen::Index(e.rows), 0)));
  add("damping_position", {w, x}, {}, product_columns(e, speed, position, kx8));
  add("inertia_position", {"acceleration", x}, {}, beside(accel_columns(e, position, kx8), rotary ? accel_columns(e, position, {}, 1, 4) : Eigen::MatrixXd(Eigen::Index(e.rows), 0)));
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

// Which part of the noise comes through the motion (white noise of the position or speed, shaped by inertia and damping) and which
// through the drive? Two non-negative variances that reproduce the residual's autocorrelation.
void split_noise(Equation &e, const Eigen::VectorXd &residual, const Eigen::VectorXd &p) {
  e.noise_motion = e.noise_drive = 0;
  if (e.electrical || e.tracks.empty()) return;
  const Track &t0 = e.tracks[0];
  const int step = t0.row.size() > 1 ? std::max(1, t0.row[1] - t0.row[0]) : 1, n = 2 * t0.kernel.half + 1;
  const bool from_speed = !t0.speed_raw.empty();
  double a = 0, b = 0;
  int free_column = 0;
  for (std::size_t c = 0; c < e.base_column.size() && c < 2; ++c) (c ? b : a) = e.base_column[c].given ? e.base_column[c].value : p[free_column++];
  std::vector<double> motion(std::size_t(n), 0.0), drive(std::size_t(n), 0.0);
  for (int k = 0; k < n; ++k) {
    auto i = std::size_t(k);
    motion[i] = from_speed ? a * t0.kernel.w[1][i] + b * t0.kernel.w[0][i] : a * t0.kernel.w[2][i] + b * t0.kernel.w[1][i];
    drive[i] = e.gain * t0.kernel.w[0][i];
  }
  const int lags = 5;
  double m[2][2] = {{0, 0}, {0, 0}}, v[2] = {0, 0};
  for (int l = 0; l < lags; ++l) {
    double r1 = 0, r0 = 0, c = 0, count = 0;
    for (int k = 0; k + l * step < n; ++k) r1 += motion[std::size_t(k)] * motion[std::size_t(k + l * step)], r0 += drive[std::size_t(k)] * drive[std::size_t(k + l * step)];
    for (const Track &t : e.tracks)
      for (std::size_t r = std::size_t(l); r < t.row.size(); ++r)
        if (t.run[r] == t.run[r - std::size_t(l)]) c += residual[Eigen::Index(t.first + r)] * residual[Eigen::Index(t.first + r) - l], count += 1;
    c /= std::max(1.0, count);
    double w = l ? 1 : 2;
    m[0][0] += w * r1 * r1; m[0][1] += w * r1 * r0; m[1][1] += w * r0 * r0;
    v[0] += w * r1 * c; v[1] += w * r0 * c;
  }
  double det = m[0][0] * m[1][1] - m[0][1] * m[0][1];
  double x = det > 0 ? (v[0] * m[1][1] - v[1] * m[0][1]) / det : 0, y = det > 0 ? (v[1] * m[0][0] - v[0] * m[0][1]) / det : 0;
  if (x < 0 || !(det > 0)) x = 0, y = m[1][1] > 0 ? v[1] / m[1][1] : 0;
  if (y < 0) y = 0, x = m[0][0] > 0 ? v[0] / m[0][0] : 0;
  e.noise_motion = std::max(0.0, x);
  e.noise_drive = std::max(0.0, y);
}

}  // namespace

std::vector<Family> make_families(const Equation &e) {
  std::vector<Family> out;
  if (e.electrical) electrical_families(e, out);
  else mechanical_families(e, out);
  return out;
}

BlockGram::BlockGram(const Equation &e, const Eigen::MatrixXd &x, const Eigen::VectorXd &y) : fold_(e.block_fold), held_(e.block_held_out) {
  const std::size_t blocks = e.block_held_out.size();
  const Eigen::Index n = x.cols();
  gram_.assign(blocks, Eigen::MatrixXd::Zero(n, n));
  xy_.assign(blocks, Eigen::VectorXd::Zero(n));
  yy_.assign(blocks, 0);
  rows_.assign(blocks, 0);
  std::size_t a = 0;
  while (a < e.rows) {   // blocks are contiguous stretches (of tracks)
    std::size_t b = a;
    while (b < e.rows && e.block[b] == e.block[a]) ++b;
    auto xs = x.middleRows(Eigen::Index(a), Eigen::Index(b - a));
    auto ys = y.segment(Eigen::Index(a), Eigen::Index(b - a));
    std::size_t k = std::size_t(e.block[a]);
    gram_[k].selfadjointView<Eigen::Lower>().rankUpdate(xs.transpose());
    xy_[k] += xs.transpose() * ys;
    yy_[k] += ys.squaredNorm();
    for (std::size_t r = a; r < b; ++r) rows_[k] += e.weight[r];
    a = b;
  }
  all_ = training_ = Eigen::MatrixXd::Zero(n, n);
  all_xy_ = training_xy_ = Eigen::VectorXd::Zero(n);
  for (std::size_t k = 0; k < blocks; ++k) {
    gram_[k].triangularView<Eigen::StrictlyUpper>() = gram_[k].transpose();
    all_ += gram_[k];
    all_xy_ += xy_[k];
    if (!held_[k]) training_ += gram_[k], training_xy_ += xy_[k];
    const std::size_t f = std::size_t(fold_[k]);
    if (f >= fold_gram_.size()) fold_gram_.resize(f + 1, Eigen::MatrixXd::Zero(n, n)), fold_xy_.resize(f + 1, Eigen::VectorXd::Zero(n));
    fold_gram_[f] += gram_[k];
    fold_xy_[f] += xy_[k];
  }
}

Eigen::VectorXd BlockGram::solve_without(const std::vector<int> &columns, const std::vector<double> &ridge, int fold, bool training_only) const {
  const Eigen::Index m = Eigen::Index(columns.size());
  Eigen::MatrixXd g(m, m);
  Eigen::VectorXd r(m);
  const Eigen::MatrixXd &source = training_only ? training_ : all_;
  const Eigen::VectorXd &sxy = training_only ? training_xy_ : all_xy_;
  for (Eigen::Index i = 0; i < m; ++i) {
    int ci = columns[std::size_t(i)];
    r[i] = sxy[ci] - (fold >= 0 ? fold_xy_[std::size_t(fold)][ci] : 0);
    for (Eigen::Index j = 0; j < m; ++j) g(i, j) = source(ci, columns[std::size_t(j)]) - (fold >= 0 ? fold_gram_[std::size_t(fold)](ci, columns[std::size_t(j)]) : 0);
  }
  Eigen::VectorXd d(m);
  for (Eigen::Index i = 0; i < m; ++i) d[i] = 1 / std::sqrt(std::max(all_(columns[std::size_t(i)], columns[std::size_t(i)]), 1e-300));
  g = d.asDiagonal() * g * d.asDiagonal();
  for (Eigen::Index i = 0; i < m; ++i) g(i, i) += 1e-9 + (ridge.empty() ? 0 : ridge[std::size_t(i)]);
  return d.asDiagonal() * g.ldlt().solve(d.asDiagonal() * r);
}

double BlockGram::block_sse(int block, const std::vector<int> &columns, const Eigen::VectorXd &p) const {
  const auto b = std::size_t(block);
  const Eigen::Index m = Eigen::Index(columns.size());
  double s = yy_[b];
  for (Eigen::Index i = 0; i < m; ++i) {
    double inner = 0;
    for (Eigen::Index j = 0; j < m; ++j) inner += gram_[b](columns[std::size_t(i)], columns[std::size_t(j)]) * p[j];
    s += p[i] * (inner - 2 * xy_[b][columns[std::size_t(i)]]);
  }
  return std::max(0.0, s);
}

BlockGram::Score BlockGram::cross_validate(const std::vector<int> &columns, const std::vector<double> &ridge) const {
  Score score;
  score.rows = rows_;
  Eigen::VectorXd p;
  for (std::size_t b = 0; b < gram_.size(); ++b) {
    if (b == 0 || fold_[b] != fold_[b - 1]) p = solve_without(columns, ridge, fold_[b], false);
    double s = block_sse(int(b), columns, p);
    score.sse.push_back(s);
    score.total += s;
  }
  p = solve_without(columns, ridge, -1, true);
  for (std::size_t b = 0; b < gram_.size(); ++b)
    if (held_[b]) score.held += block_sse(int(b), columns, p), score.held_rows += rows_[b];
  return score;
}

Eigen::VectorXd BlockGram::solve(const std::vector<int> &columns, const std::vector<double> &ridge, bool training_only) const {
  return solve_without(columns, ridge, -1, training_only);
}

Floor find_floor(Equation &e, const std::vector<Family> &families) {
  Floor f;
  Eigen::Index columns = e.base.cols();
  for (const Family &g : families) columns += g.column.cols();
  Eigen::MatrixXd x(Eigen::Index(e.rows), columns);
  x.leftCols(e.base.cols()) = e.base;
  Eigen::Index at = e.base.cols();
  for (const Family &g : families) x.middleCols(at, g.column.cols()) = g.column, at += g.column.cols();
  std::vector<int> base, all;
  for (int c = 0; c < int(columns); ++c) (c < int(e.base.cols()) ? base : all).push_back(c);
  all.insert(all.begin(), base.begin(), base.end());
  auto ridge_of = [&](double r) { std::vector<double> v(std::size_t(columns), r); for (std::size_t c = 0; c < base.size(); ++c) v[c] = 0; return v; };
  e.ar.clear();
  e.weight.assign(e.rows, 1.0);
  double best_ridge = 1e-3;
  for (int pass = 0; pass < 3; ++pass) {
    Eigen::MatrixXd wx = whiten(e, x);
    Eigen::VectorXd wy = whiten(e, e.y);
    BlockGram gram(e, wx, wy);
    double best = INFINITY;
    for (double r : {1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0}) {
      BlockGram::Score s = gram.cross_validate(all, ridge_of(r));
      if (s.total < best) best = s.total, best_ridge = r, f.flexible_block = s.sse;
    }
    BlockGram::Score nominal = gram.cross_validate(base, {});
    f.nominal_sse = nominal.total;
    f.nominal_block = nominal.sse;
    f.flexible_sse = best;
    f.rows = 0;
    for (double w : e.weight) f.rows += w;
    Eigen::VectorXd p = gram.solve(all, ridge_of(best_ridge), false);
    f.flexible = x.rightCols(columns - e.base.cols()) * p.tail(columns - e.base.cols());
    Eigen::VectorXd residual = e.y - x * p;
    f.hi = std::sqrt(residual.squaredNorm() / double(e.rows));
    if (pass == 1) {
      mask_outliers(e, residual);
      if (!e.mask.empty())
        for (Eigen::Index k = 0; k < residual.size(); ++k)
          if (e.mask[std::size_t(k)]) residual[k] = 0;
    }
    if (pass < 2) fit_whitening(e, residual, kArOrder);
    if (pass == 2) split_noise(e, residual, p);
  }
  f.lo = std::min(e.floor_lo, f.hi);
  return f;
}

}  // namespace driveid::diagnose
