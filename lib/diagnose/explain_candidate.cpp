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

bool made_of_drive(const Candidate &c);

bool is(const Candidate &c, const char *name) { return c.info && !std::strcmp(c.info->name, name); }

// Load position behind spring, damper and (with gap > 0) clearance, driven by the measured motor position. Written without
// the motor's speed: with q = x' - 2 zeta w theta the drive enters undifferentiated.
void load_position(const Track &t, double w, double zeta, double gap, std::vector<double> &x) {
  const std::vector<double> &position = !(gap > 0) || t.position_smooth.empty() ? t.position : t.position_smooth;
  const std::size_t n = position.size();
  x.resize(n);
  if (n == 0) return;
  const int sub = std::max(1, int(std::ceil(w * t.dt_s / 0.25)));
  const double h = t.dt_s / sub;
  double p = position[0], v = n > 1 ? (position[std::min<std::size_t>(n - 1, 8)] - position[0]) / (t.dt_s * double(std::min<std::size_t>(n - 1, 8))) : 0;
  const double half = 0.5 * gap;
  for (std::size_t k = 0; k < n; ++k) {
    x[k] = p;
    if (k + 1 == n) break;
    const double a = position[k], b = position[k + 1], rate = t.state.empty() ? (b - a) / t.dt_s : 0.5 * (t.state[k].speed + t.state[k + 1].speed);
    for (int j = 0; j < sub; ++j) {
      const double m = a + (b - a) * (j + 0.5) / sub;
      const double q = p + 0.5 * h * v, twist = m - q;
      double deflection = twist > half ? twist - half : twist < -half ? twist + half : 0, force = 0;
      if (half <= 0 || deflection != 0) {
        // semi-implicit in the damping so that stiff contacts stay stable
        force = (w * w * deflection + 2 * zeta * w * (rate - v)) / (1 + zeta * w * h + 0.25 * w * w * h * h);
        if (half > 0 && force * deflection < 0) force = 0;   // contact pushes, it does not pull
      }
      p += h * v + 0.5 * h * h * force;
      v += h * force;
    }
  }
}

bool made_of_drive(const Candidate &c) { return is(c, "torque_saturation") || is(c, "torque_ripple") || is(c, "load_dependent_friction"); }

}  // namespace

// Coefficients of columns from which the drive was taken, back to coefficients of the columns themselves: the solution is
// drive (1 + sum c part) - sum c column = inertia ..., so everything is divided by the factor of the drive.
double drive_factor(const Term &term, const Eigen::VectorXd &linear) {
  double factor = term.drive_scale == 1 ? 1.0 : 1.0 / term.drive_scale;
  for (Eigen::Index k = 0; k < term.drive_part.size() && k < linear.size(); ++k) factor += linear[k] * term.drive_part[k];
  return factor;
}

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
          x.lo = std::max(s.lo, 0.004 * r.speed);
          x.hi = std::max(2 * x.lo, std::min(s.hi, 0.6 * r.speed));
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
          x.grid = linear(std::max(x.lo, 0.02 * r.drive), 0.9 * r.drive, 22);
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
      axis(0.002, 0.25, true, {0.01, 0.05, 0.2});   // a spring rings: what does not is a filter of the position's noise
      c.columns = 1;
    } else if (is(c, "backlash")) {
      double hi = 0.35 * kTwoPi / r.dt;
      hi = std::min(hi, kTwoPi * 3 / r.kernel_s);
      const double least = std::max(1e-5 * range, 3 * e.quantum), most = std::max(4 * least, std::min(0.2, 0.2 * range));
      axis(least, 2 * most, true, logarithmic(least * 1.5, most, 9));
      axis(kTwoPi * 4, hi, true, logarithmic(kTwoPi * 15, hi, 4));
      axis(0.01, 0.9, true, {0.08, 0.4});
      c.columns = 1;
    }
    if (c.columns == 0 && !is(c, "delay")) continue;
    out.push_back(std::move(c));
  }
  return out;
}

Term realise(const Equation &e, const Candidate &c, const std::vector<double> &shape, const Nominal &nominal) {
  Term term;
  const Eigen::Index rows = Eigen::Index(e.rows);
  if (is(c, "delay")) {
    term.column.resize(rows, 0);
    term.taken = delayed_target(e, 0) - delayed_target(e, shape[0]);
    return term;
  }
  if (is(c, "encoder_eccentricity")) {
    term.column.resize(rows, 2);
    for (int q = 0; q < 2; ++q) {
      FineSignal f = [q](const Track &t, std::vector<double> &x) {
        x.resize(t.position.size());
        for (std::size_t k = 0; k < x.size(); ++k) x[k] = q ? std::cos(t.position[k]) : std::sin(t.position[k]);
      };
      term.column.col(q) = -(nominal.inertia * stack(e, f, 2) + nominal.damping * stack(e, f, 1));
    }
    return term;
  }
  if (is(c, "compliance") || is(c, "backlash")) {
    const bool gap = is(c, "backlash");
    const double w = shape[gap ? 1 : 0], zeta = shape[gap ? 2 : 1], width = gap ? shape[0] : 0;
    term.column.resize(rows, 1);
    term.column.col(0) = stack(e, [&](const Track &t, std::vector<double> &x) {
      load_position(t, w, zeta, width, x);
      const std::vector<double> &motor = !gap || t.position_smooth.empty() ? t.position : t.position_smooth;
      for (std::size_t k = 0; k < x.size(); ++k) x[k] -= motor[k];
    }, 2);
    return term;
  }
  if (is(c, "inertia_change")) {
    // acceleration rows themselves (smoothed once, as the nominal inertia's), switched at the instant
    bool from_speed = !e.tracks[0].speed_raw.empty();
    term.column.resize(rows, 1);
    term.column.col(0) = stack(e, [from_speed](const Track &t, std::vector<double> &x) { x = from_speed ? t.speed_raw : t.position; }, from_speed ? 1 : 2);
    for (const Track &t : e.tracks)
      for (std::size_t r = 0; r < t.row.size(); ++r) {
        double late = (t.state[std::size_t(t.row[r])].t_s - shape[0]) / (t.kernel.half * t.dt_s);
        term.column(Eigen::Index(t.first + r), 0) *= std::clamp(0.5 + late, 0.0, 1.0);
      }
    return term;
  }
  if (!c.info) {   // own effect
    driveid_formula f;
    char message[128];
    if (driveid_formula_parse(c.formula.c_str(), &f, message, sizeof message) < 0) {
      term.column = Eigen::MatrixXd::Zero(rows, c.columns);
      return term;
    }
    std::vector<double> param(DRIVEID_FORMULA_PARAMS_MAX, 1.0);
    std::size_t at = 0;
    for (std::uint32_t k = 0; k < f.params; ++k)
      if (!(f.linear_mask >> k & 1)) param[k] = shape[at++];
    term.column.resize(rows, c.columns);
    int q = 0;
    for (std::uint32_t k = 0; k < f.params; ++k) {
      if (!(f.linear_mask >> k & 1)) continue;
      term.column.col(q++) = stack(e, [&](const Track &t, std::vector<double> &x) {
        double column[DRIVEID_FORMULA_PARAMS_MAX];
        x.resize(t.state.size());
        for (std::size_t j = 0; j < x.size(); ++j) driveid_formula_columns(&f, &t.state[j], param.data(), column), x[j] = column[k];
      }, 0);
    }
    if (c.columns == 0 || f.linear_mask == 0)
      term.taken = stack(e, [&](const Track &t, std::vector<double> &x) {
        x.resize(t.state.size());
        for (std::size_t j = 0; j < x.size(); ++j) x[j] = driveid_formula_value(&f, &t.state[j], param.data(), nullptr);
      }, 0);
    return term;
  }
  Eigen::MatrixXd m = effect_columns(e, *c.info, shape.data());
  if (c.info->fixed & 1) {
    // The scale of the drive is free beside inertia and damping: what remains of it is brought back to its old size,
    // lest a threshold that swallows the whole drive count as a perfect explanation.
    Eigen::VectorXd rest = e.drive - m.col(0);
    double scale = rest.dot(e.drive) / std::max(1e-300, e.drive.squaredNorm());
    term.drive_scale = std::max(scale, 1e-3);
    term.taken = e.drive - rest / term.drive_scale;
    term.column.resize(rows, 0);
  } else if (made_of_drive(c) && !e.electrical) {
    term.drive_part.resize(m.cols());
    for (Eigen::Index k = 0; k < m.cols(); ++k) term.drive_part[k] = remove_drive(e, m.col(k));
    term.column = std::move(m);
  } else {
    term.column = std::move(m);
  }
  return term;
}

// Inside its threshold a dead zone also swallows the noise of the drive.
static double dead_zone_noise(const Equation &e, double threshold, double inertia, double damping) {
  if (e.electrical || !(e.noise_drive > 0)) return 1;
  double passed = 0, all = 0, kept = 0, square = 0;
  for (const Track &t : e.tracks)
    for (int r : t.row) {
      const double d = t.state[std::size_t(r)].drive, out = d > threshold ? d - threshold : d < -threshold ? d + threshold : 0;
      passed += out != 0;
      all += 1;
      kept += out * d;
      square += d * d;
    }
  if (!(square > 0) || !(kept > 0)) return 1;
  const Track &t0 = e.tracks[0];
  const bool from_speed = !t0.speed_raw.empty();
  const auto &wa = t0.kernel.w[from_speed ? 1 : 2], &wb = t0.kernel.w[from_speed ? 0 : 1], &w0 = t0.kernel.w[0];
  const int step = t0.row.size() > 1 ? std::max(1, t0.row[1] - t0.row[0]) : 1, n = int(w0.size()), p = int(e.ar.size());
  double motion = 0, drive = 0;
  for (int k = 0; k < n + p * step; ++k) {
    double m = 0, d = 0;
    for (int j = 0; j <= p; ++j) {
      const int i = k - j * step;
      if (i < 0 || i >= n) continue;
      const double a = j ? -e.ar[std::size_t(j - 1)] : 1;
      m += a * (inertia * wa[std::size_t(i)] + damping * wb[std::size_t(i)]);
      d += a * e.gain * w0[std::size_t(i)];
    }
    motion += e.noise_motion * m * m;
    drive += e.noise_drive * d * d;
  }
  const double scale = kept / square;
  return std::min(1.0, (motion + drive * passed / all / (scale * scale)) / std::max(1e-300, motion + drive));
}

double noise_ratio(const Equation &e, const Candidate &c, const std::vector<double> &shape, const Eigen::VectorXd &linear, double inertia, double damping) {
  if (is(c, "dead_zone")) return dead_zone_noise(e, shape[0], inertia, damping);
  if (!is(c, "compliance") && !is(c, "backlash")) return 1;
  if (!(e.noise_motion > 0) || linear.size() == 0) return 1;
  const bool gap = is(c, "backlash");
  const Track &t0 = e.tracks[0];
  const int step = t0.row.size() > 1 ? std::max(1, t0.row[1] - t0.row[0]) : 1, half = t0.kernel.half, p = int(e.ar.size());
  // response of the load to one wrong position sample (a closed gap is the worst case for filtering)
  Track pulse;
  pulse.dt_s = t0.dt_s;
  const bool smooth = gap && !t0.position_smooth.empty();
  const int before = !smooth ? 2 : t0.kernel.half + 2, after = std::min(4000, std::max(400, int(8 / (std::max(0.02, shape[gap ? 2 : 1]) * shape[gap ? 1 : 0] * t0.dt_s))));
  pulse.position.assign(std::size_t(before + after), 0.0);
  pulse.position[std::size_t(before)] = 1;
  if (smooth) {
    pulse.position_smooth.assign(pulse.position.size(), 0.0);
    for (int k = -half; k <= half; ++k) pulse.position_smooth[std::size_t(before + k)] = t0.kernel.w[0][std::size_t(k + half)];
  }
  const std::vector<double> &motor = pulse.position_smooth.empty() ? pulse.position : pulse.position_smooth;
  std::vector<double> x;
  if (smooth) pulse.position.swap(pulse.position_smooth), pulse.position_smooth = pulse.position;
  load_position(pulse, shape[gap ? 1 : 0], shape[gap ? 2 : 1], 0, x);   // a closed gap
  const bool from_speed = !t0.speed_raw.empty();
  const int margin = half + p * step, length = before + after + 2 * margin;
  std::vector<double> rigid(std::size_t(length), 0.0), spring(std::size_t(length), 0.0), drive(std::size_t(length), 0.0);
  const auto &wa = t0.kernel.w[from_speed ? 1 : 2], &wb = t0.kernel.w[from_speed ? 0 : 1];
  for (int k = 0; k <= 2 * half; ++k) {
    rigid[std::size_t(before + k)] += inertia * wa[std::size_t(k)] + damping * wb[std::size_t(k)];
    drive[std::size_t(before + k)] += e.gain * t0.kernel.w[0][std::size_t(k)];
  }
  for (int m = 0; m < before + after; ++m) {
    double d = x[std::size_t(m)] - motor[std::size_t(m)];
    if (d == 0) continue;
    for (int k = 0; k <= 2 * half; ++k) spring[std::size_t(m + k)] += linear[0] * d * wa[std::size_t(k)];
  }
  double with = 0, without = 0;
  for (int k = 0; k < length; ++k) {
    double r = rigid[std::size_t(k)], s = spring[std::size_t(k)], d = drive[std::size_t(k)];
    for (int j = 1; j <= p && k - j * step >= 0; ++j) {
      double a = e.ar[std::size_t(j - 1)];
      r -= a * rigid[std::size_t(k - j * step)];
      s -= a * spring[std::size_t(k - j * step)];
      d -= a * drive[std::size_t(k - j * step)];
    }
    without += e.noise_motion * r * r + e.noise_drive * d * d;
    with += e.noise_motion * (r + s) * (r + s) + e.noise_drive * d * d;
  }
  return without > 0 ? std::min(1.0, with / without) : 1;   // a candidate that lets more noise through is not rewarded for it
}

Eigen::VectorXd spring_on_drive(const Equation &e, double inertia, double load, double w, double zeta) {
  const double m = std::clamp(load / inertia, 0.0, 0.98);
  return stack(e, [&](const Track &t, std::vector<double> &f) {
    // (s^2 + 2 zeta w s + w^2) / ((1 - m) s^2 + 2 zeta w s + w^2), trapezoidal
    const double q = 2 / t.dt_s, b0 = q * q + 2 * zeta * w * q + w * w, b1 = 2 * (w * w - q * q), b2 = q * q - 2 * zeta * w * q + w * w;
    const double a0 = (1 - m) * q * q + 2 * zeta * w * q + w * w, a1 = 2 * (w * w - (1 - m) * q * q), a2 = (1 - m) * q * q - 2 * zeta * w * q + w * w;
    f.resize(t.state.size());
    if (f.empty()) return;
    double x1 = t.state[0].torque, x2 = x1, y1 = x1, y2 = x1;
    for (std::size_t k = 0; k < f.size(); ++k) {
      const double x0 = t.state[k].torque, y0 = (b0 * x0 + b1 * x1 + b2 * x2 - a1 * y1 - a2 * y2) / a0;
      f[k] = x0 - y0;
      x2 = x1; x1 = x0; y2 = y1; y1 = y0;
    }
  }, 0);
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
  if (is(c, "compliance") || is(c, "backlash")) return linear[0] > 0 && linear[0] < 0.995 * inertia;
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
    if (c.info->param[k].dimension == DRIVEID_DIM_ONE && p[k] > c.info->param[k].hi) return false;
  }
  return true;
}

std::vector<double> shape_of(const Equation &e, const Candidate &c, const std::vector<double> &p, double inertia) {
  (void)inertia;
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

Equation thinned(const Equation &e, std::size_t wanted) {
  if (e.rows <= wanted + wanted / 4) return e;
  Equation out = e;
  out.tracks.clear();
  const double keep = double(wanted) / double(e.rows);
  for (const Track &t : e.tracks) {
    if (t.row.empty()) continue;
    // stretches of at least 2 s or 40 rows, spread evenly
    const int per = t.row.size() > 1 ? std::max(1, t.row[1] - t.row[0]) : 1;
    std::size_t stretch = std::max<std::size_t>(40, std::size_t(2.0 / (t.dt_s * per)));
    std::size_t many = std::max<std::size_t>(1, std::size_t(double(t.row.size()) * keep / double(stretch)));
    stretch = std::min(t.row.size(), std::size_t(double(t.row.size()) * keep / double(many)) + 1);
    for (std::size_t m = 0; m < many; ++m) {
      std::size_t a = many == 1 ? (t.row.size() - stretch) / 2 : m * (t.row.size() - stretch) / (many - 1), b = a + stretch;
      if (m && a <= (m - 1) * (t.row.size() - stretch) / (many - 1) + stretch) continue;
      std::size_t from = std::size_t(std::max(0, t.row[a] - t.kernel.half - 2)), to = std::min(t.state.size(), std::size_t(t.row[b - 1] + t.kernel.half + 3));
      Track s;
      s.record = t.record;
      s.held_out = t.held_out;
      s.part = t.part;
      s.t0_s = t.t0_s + double(from) * t.dt_s;
      s.dt_s = t.dt_s;
      s.kernel = t.kernel;
      auto cut = [&](const auto &v) { using V = std::decay_t<decltype(v)>; return v.empty() ? V() : V(v.begin() + std::ptrdiff_t(from), v.begin() + std::ptrdiff_t(to)); };
      s.state = cut(t.state);
      s.position = cut(t.position);
      s.speed_raw = cut(t.speed_raw);
      s.drive_raw = cut(t.drive_raw);
      s.rest = cut(t.rest);
      s.position_smooth = cut(t.position_smooth);
      s.current_raw = cut(t.current_raw);
      s.first = t.first + a;   // for now: where it comes from
      for (std::size_t r = a; r < b; ++r) s.row.push_back(t.row[r] - int(from)), s.run.push_back(t.run[r]);
      out.tracks.push_back(std::move(s));
    }
  }
  std::size_t rows = 0;
  for (Track &t : out.tracks) rows += t.row.size();
  out.y.resize(Eigen::Index(rows));
  out.drive.resize(Eigen::Index(rows));
  out.base.resize(Eigen::Index(rows), e.base.cols());
  if (e.current.size()) out.current.resize(Eigen::Index(rows)), out.current_smooth.resize(Eigen::Index(rows));
  out.block.resize(rows);
  if (!e.mask.empty()) out.mask.resize(rows);
  out.weight.assign(rows, 1.0);
  rows = 0;
  for (Track &t : out.tracks) {
    const auto n = Eigen::Index(t.row.size()), from = Eigen::Index(t.first), to = Eigen::Index(rows);
    out.y.segment(to, n) = e.y.segment(from, n);
    out.drive.segment(to, n) = e.drive.segment(from, n);
    out.base.middleRows(to, n) = e.base.middleRows(from, n);
    if (e.current.size()) out.current.segment(to, n) = e.current.segment(from, n), out.current_smooth.segment(to, n) = e.current_smooth.segment(from, n);
    for (Eigen::Index k = 0; k < n; ++k) out.block[std::size_t(to + k)] = e.block[std::size_t(from + k)], (e.mask.empty() ? void() : void(out.mask[std::size_t(to + k)] = e.mask[std::size_t(from + k)])), out.weight[std::size_t(to + k)] = k < Eigen::Index(e.ar.size()) ? 0.0 : e.weight[std::size_t(from + k)];
    t.first = rows;
    rows += t.row.size();
  }
  out.rows = rows;
  return out;
}

}  // namespace driveid::diagnose
