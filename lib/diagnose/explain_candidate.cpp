// SPDX-License-Identifier: Apache-2.0
#include "diagnose/explain_candidate.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace driveid::diagnose {
namespace {

constexpr double kTwoPi = 6.283185307179586;

std::vector<double> logarithmic(double lo, double hi, int n) {
  std::vector<double> g;
  for (int k = 0; k < n; ++k) g.push_back(lo * std::pow(hi / lo, n == 1 ? 0.5 : double(k) / (n - 1)));
  return g;
}

std::vector<double> linear(double lo, double hi, int n) {
  std::vector<double> g;
  for (int k = 0; k < n; ++k) g.push_back(lo + (hi - lo) * (n == 1 ? 0.5 : double(k) / (n - 1)));
  return g;
}

struct Ranges {
  double speed = 0, slow = 0, position_lo = INFINITY, position_hi = -INFINITY, drive = 0, drive_lo = INFINITY, drive_hi = -INFINITY, span = 0, dt = 0, kernel_s = 0, heat = 0, current = 0;
  bool temperature = false;
};

Ranges ranges_of(const Equation &e) {
  Ranges r;
  std::vector<double> drives, speeds;
  for (const Track &t : e.tracks) {
    r.dt = std::max(r.dt, t.dt_s);
    r.kernel_s = std::max(r.kernel_s, t.kernel.half * t.dt_s);
    for (std::size_t k = 0; k < t.state.size(); k += 3) {
      const auto &s = t.state[k];
      r.speed = std::max(r.speed, std::fabs(s.speed));
      r.position_lo = std::min(r.position_lo, s.angle);
      r.position_hi = std::max(r.position_hi, s.angle);
      r.span = std::max(r.span, s.t_s);
      r.current = std::max(r.current, std::fabs(s.current_A));
      drives.push_back(std::fabs(s.drive));
      r.temperature |= s.has_temperature != 0;
    }
  }
  if (!drives.empty()) {
    std::sort(drives.begin(), drives.end());
    r.drive = drives[drives.size() * 98 / 100];
  }
  return r;
}

}  // namespace

bool is(const Candidate &c, const char *name) { return c.info && !std::strcmp(c.info->name, name); }

std::vector<Candidate> make_candidates(const Equation &e) {
  std::vector<Candidate> out;
  const Ranges r = ranges_of(e);
  const bool rotary = e.frame != DRIVEID_FRAME_FORCE && e.frame != DRIVEID_FRAME_AMPERE_LINEAR;
  const bool has_current = e.drive_unit == 'A' || e.electrical;
  const double range = std::max(1e-12, r.position_hi - r.position_lo);
  for (std::uint32_t k = 0; k < driveid_effect_count(); ++k) {
    const driveid_effect_info *info = driveid_effect_at(k);
    Candidate c;
    c.info = info;
    c.name = info->name;
    c.columns = info->columns;
    c.speed = r.speed;
    if (!(info->domains & (e.electrical ? DRIVEID_EFFECT_ELECTRICAL : DRIVEID_EFFECT_MECHANICAL))) continue;
    if ((info->needs & DRIVEID_NEED_ROTARY) && !rotary) continue;
    if (is(c, "gravity_unbalance") && !rotary) continue;
    if ((info->needs & DRIVEID_NEED_CURRENT) && !has_current && !is(c, "current_offset")) continue;
    if (is(c, "current_offset") && !has_current) continue;
    if (e.electrical && is(c, "dead_zone")) continue;   // in the voltage equation a dead zone of the input is the inverter's lost voltage
    if ((is(c, "gravity_unbalance") || is(c, "encoder_eccentricity")) && range < 1.0) continue;
    for (int a = 0; a < info->shapes; ++a) {
      const driveid_effect_shape &s = info->shape[a];
      ShapeAxis x;
      x.lo = s.lo;
      x.hi = s.hi;
      x.logarithmic = s.logarithmic;
      x.whole = s.whole;
      switch (s.dimension) {
        case DRIVEID_DIM_SPEED:
          x.lo = std::max(s.lo, 0.004 * r.speed);   // above a fifth of the speed it is no stiction but another law of drag
          x.hi = std::max(2 * x.lo, std::min(s.hi, 0.2 * r.speed));
          x.grid = logarithmic(x.lo, x.hi, info->shapes > 2 ? 5 : 12);
          break;
        case DRIVEID_DIM_LENGTH:
          x.lo = std::max({s.lo, 1e-6 * range, (is(c, "lugre") ? 3 : 0.5) * e.quantum});   // pre-sliding of a few counts is not seen
          x.hi = std::max(2 * x.lo, std::min(s.hi, 0.5 * range));
          if (info->shapes > 2) x.hi = std::max(2 * x.lo, std::min(x.hi, rotary ? 0.02 : 2e-4));
          x.grid = logarithmic(std::max(x.lo, info->shapes > 2 ? 1e-3 * x.hi : 3e-4 * x.hi), x.hi, info->shapes > 2 ? 6 : 14);
          break;
        case DRIVEID_DIM_ORDER:
          if (rotary) {
            if (range < kTwoPi * 0.75) x.lo = std::ceil(kTwoPi / range);
            for (double n = std::max(x.lo, is(c, "cogging") || is(c, "torque_ripple") ? 2.0 : 1.0); n <= std::min(s.hi, 150.0); n += 1) x.grid.push_back(n);
          } else {
            x.whole = false;
            const double top = std::max(4.0, std::min(400.0, s.hi));   // fewer than three periods are a force over position, not cogging
            for (double n = 3; n <= (s.hi < 20 ? 20.0 : top); n += 0.5) x.grid.push_back(kTwoPi * n / range);
            x.lo = x.grid.front();
            x.hi = x.grid.back();
          }
          if (x.grid.empty()) x.grid.push_back(x.lo);
          c.trials = double(x.grid.size());
          break;
        case DRIVEID_DIM_TIME:
          if (is(c, "lugre")) {
            x.lo = 0;
            x.hi = std::min(s.hi, 0.02);
            x.grid = {0.0, 2e-3};
          } else if (is(c, "inertia_change")) {
            x.lo = 0;
            x.hi = r.span;
            x.grid = linear(0.04 * r.span, 0.96 * r.span, 40);
            c.trials = 20;
          } else {
            if (r.temperature) x.grid = {s.typical};
            else x.grid = logarithmic(std::max(s.lo, 0.1 * r.span), std::max(s.lo * 2, 6 * r.span), 8);
            x.lo = std::max(s.lo, 0.05 * r.span);   // a drift is slow against the motion
            x.hi = 20 * std::max(1.0, r.span);
          }
          break;
        case DRIVEID_DIM_DRIVE:
          x.lo = std::min(0.5 * r.drive, std::max(1e-4 * r.drive, is(c, "dead_zone") ? 0.5 * e.input_noise : 0.0));   // inside the input's noise nothing is seen
          x.hi = r.drive;
          x.grid = is(c, "dead_zone") ? logarithmic(std::max(x.lo, 0.004 * r.drive), 0.9 * r.drive, 22) : linear(std::max(x.lo, 0.02 * r.drive), 0.9 * r.drive, 22);
          break;
        default:
          x.grid = linear(s.lo, s.hi, info->shapes > 2 ? 3 : 5);
          if (is(c, "lugre")) x.hi = 4, x.grid = {1.0, 1.4, 2.0};
      }
      c.axis.push_back(std::move(x));
    }
    auto axis = [&](double lo, double hi, bool log, std::vector<double> grid) { c.axis.push_back({lo, hi, log, false, std::move(grid)}); };
    if (is(c, "delay")) {
      double most = std::max(60 * r.dt, 3 * r.kernel_s);
      std::vector<double> g;
      const double least = e.electrical ? 1.7 : 1.0;
      for (double d = least; d * r.dt <= most; d *= 1.3) g.push_back(d * r.dt);
      axis((least - 0.1) * r.dt, most, false, std::move(g));   // less is a matter of how the input was read
      c.columns = 0;
    } else if (is(c, "encoder_eccentricity")) {
      c.columns = 2;
    } else if (is(c, "compliance")) {
      double hi = 0.35 * kTwoPi / r.dt, lo = kTwoPi * std::max(0.5, 4 / std::max(r.span, 1.0));
      hi = std::min(hi, kTwoPi * 1.2 / r.kernel_s * 2);
      axis(lo, hi, true, logarithmic(lo * 2, hi, 18));
      axis(0.002, 0.25, true, {0.01, 0.05, 0.15});
      c.columns = 1;
    } else if (is(c, "backlash")) {
      double hi = 0.35 * kTwoPi / r.dt;
      hi = std::min(hi, kTwoPi * 3 / r.kernel_s);
      const double least = std::max(1e-5 * range, 3 * e.quantum), most = std::max(4 * least, std::min(0.5, 0.2 * range));
      axis(least, 2 * most, true, logarithmic(least * 1.5, most, 20));
      axis(kTwoPi * 4, hi, true, logarithmic(kTwoPi * 15, hi, 4));
      axis(0.01, 0.9, true, {0.08, 0.4});
      c.columns = 1;
    }
    if (c.columns == 0 && !is(c, "delay")) continue;
    out.push_back(std::move(c));
  }
  return out;
}

std::vector<double> publish(const Equation &e, const Candidate &c, const std::vector<double> &shape, const Eigen::VectorXd &linear) {
  std::vector<double> p(DRIVEID_EFFECT_PARAMS_MAX, 0.0);
  if (is(c, "delay")) return {shape[0]};
  if (is(c, "encoder_eccentricity")) return {std::hypot(linear[0], linear[1]), std::atan2(linear[1], linear[0])};
  if (is(c, "compliance")) return {linear[0], linear[0] * shape[0] * shape[0], 2 * shape[1] * shape[0] * linear[0]};
  if (is(c, "backlash")) return {shape[0], linear[0], linear[0] * shape[1] * shape[1], 2 * shape[2] * shape[1] * linear[0]};
  if (!c.info) return std::vector<double>(linear.data(), linear.data() + linear.size());
  double coefficient[DRIVEID_EFFECT_COLUMNS_MAX] = {1, 1, 1, 1};
  for (Eigen::Index k = 0; k < linear.size() && k < DRIVEID_EFFECT_COLUMNS_MAX; ++k) coefficient[k] = linear[k];
  driveid_effect_publish(c.info, shape.data(), coefficient, e.gain, p.data());
  p.resize(c.info->params);
  return p;
}

bool lawful(const Equation &e, const Candidate &c, const std::vector<double> &shape, const Eigen::VectorXd &linear, double inertia) {
  if (!c.info) return true;
  for (Eigen::Index k = 0; k < linear.size(); ++k)
    if (!std::isfinite(linear[k])) return false;
  if (is(c, "dead_zone") && shape[0] < 0.6 * e.input_noise) return false;   // inside the input's noise, however it is averaged
  if (is(c, "compliance") && shape[1] > 0.2) return false;   // what does not ring is a filter, not a spring
  if (is(c, "compliance") || is(c, "backlash")) return linear[0] > 0.01 * inertia && linear[0] < 0.995 * inertia;   // less is no second mass
  if (is(c, "encoder_eccentricity")) return std::hypot(linear[0], linear[1]) < 0.5;
  if (is(c, "stribeck") && linear[1] <= 0) return false;
  if (is(c, "torque_saturation") && linear[0] <= 0) return false;
  std::vector<double> p = publish(e, c, shape, linear);
  if (is(c, "asymmetric_friction")) {   // one law may be nil: a tenth of the other's size is its uncertainty
    const double size = std::max({std::fabs(p[0]), std::fabs(p[1]), std::fabs(p[2]) * c.speed});
    return std::isfinite(size) && std::min(p[0], p[1]) > -0.1 * size;
  }
  for (std::size_t k = 0; k < p.size(); ++k) {
    if (!std::isfinite(p[k])) return false;
    if (c.info->param[k].lo == 0.0 && p[k] < 0) return false;
    if (is(c, "torque_saturation") && p[k] >= c.info->param[k].hi) return false;   // a knee beyond all bounds is none
    if (c.info->param[k].dimension == DRIVEID_DIM_ONE && p[k] > c.info->param[k].hi) return false;
  }
  return true;
}

std::vector<double> shape_of(const Equation &e, const Candidate &c, const std::vector<double> &p) {
  if (is(c, "delay")) return {p[0]};
  if (is(c, "encoder_eccentricity")) return {};
  if (is(c, "compliance")) return {std::sqrt(std::max(1e-12, p[1] / p[0])), std::max(1e-4, p[2] / (2 * std::sqrt(std::max(1e-300, p[1] * p[0]))))};
  if (is(c, "backlash")) return {p[0], std::sqrt(std::max(1e-12, p[2] / p[1])), std::max(1e-4, p[3] / (2 * std::sqrt(std::max(1e-300, p[2] * p[1]))))};
  if (!c.info) return {};
  double shape[DRIVEID_EFFECT_SHAPES_MAX] = {0, 0, 0, 0}, linear[DRIVEID_EFFECT_COLUMNS_MAX];
  driveid_effect_resolve(c.info, p.data(), e.gain, shape, linear);
  return std::vector<double>(shape, shape + c.info->shapes);
}

bool subsumes(const Candidate &a, const Candidate &b) {
  if (!a.info) return false;
  for (const char *n : a.info->subsumes)
    if (n && b.name == n) return true;
  if (is(a, "backlash") && is(b, "compliance")) return true;
  return false;
}

Candidate own_candidate(const driveid_effect_use &use, std::string &error) {
  Candidate c;
  c.name = use.name;
  c.formula = use.formula;
  driveid_formula f;
  char message[200] = "";
  if (driveid_formula_parse(use.formula, &f, message, sizeof message) < 0) {
    error = message;
    return c;
  }
  c.columns = 0;
  for (std::uint32_t k = 0; k < f.params; ++k) {
    if (f.linear_mask >> k & 1) { ++c.columns; continue; }
    double value = 1;
    for (std::uint32_t j = 0; j < use.params; ++j)
      if (!std::strcmp(use.param[j].name, f.param[k]) && use.param[j].state != DRIVEID_PARAM_UNSET) value = use.param[j].value;
    ShapeAxis x;
    x.lo = value > 0 ? value * 1e-3 : -1e3;
    x.hi = value > 0 ? value * 1e3 : 1e3;
    x.logarithmic = value > 0;
    x.grid = value > 0 ? logarithmic(0.03 * value, 30 * value, 9) : linear(-3, 3, 9);
    c.axis.push_back(std::move(x));
  }
  return c;
}

}  // namespace driveid::diagnose
