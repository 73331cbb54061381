// SPDX-License-Identifier: Apache-2.0
// What a candidate does to the noise: a filter that only lets less of it through explains nothing.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "diagnose/explain_candidate.hpp"

namespace driveid::diagnose {
namespace {

// Inside its threshold a dead zone also swallows the noise of the drive.
double dead_zone_noise(const Equation &e, double threshold, double inertia, double damping) {
  const double noise_drive = std::max(e.noise_drive, e.input_noise * e.input_noise);   // the residual's split may hand it to the motion
  if (e.electrical || !(noise_drive > 0)) return 1;
  const double inside = 1 - 1 / double(averaged_samples(e, threshold));   // of the noise, where the drive is below the threshold
  double passed = 0, all = 0, kept = 0, square = 0;
  for (const Track &t : e.tracks)
    for (int r : t.row) {
      const double d = t.state[std::size_t(r)].drive, out = d > threshold ? d - threshold : d < -threshold ? d + threshold : 0;
      passed += out != 0 ? 1 : inside;
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
    drive += noise_drive * d * d;
  }
  const double scale = kept / square;
  return std::min(1.0, (motion + drive * passed / all / (scale * scale)) / std::max(1e-300, motion + drive));
}

}  // namespace

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

Eigen::VectorXd spring_on_drive(const Equation &e, double inertia, double load, double w, double zeta, const std::vector<std::vector<double>> &losses) {
  const double m = std::clamp(load / inertia, 0.0, 0.98);
  std::size_t track = 0;
  return stack(e, [&](const Track &t, std::vector<double> &f) {
    // (s^2 + 2 zeta w s + w^2) / ((1 - m) s^2 + 2 zeta w s + w^2), trapezoidal
    const double q = 2 / t.dt_s, b0 = q * q + 2 * zeta * w * q + w * w, b1 = 2 * (w * w - q * q), b2 = q * q - 2 * zeta * w * q + w * w;
    const double a0 = (1 - m) * q * q + 2 * zeta * w * q + w * w, a1 = 2 * (w * w - (1 - m) * q * q), a2 = (1 - m) * q * q - 2 * zeta * w * q + w * w;
    const std::vector<double> *lost = losses.empty() ? nullptr : &losses[track++];
    f.resize(t.state.size());
    if (f.empty()) return;
    auto input = [&](std::size_t k) { return t.state[k].torque - (lost ? (*lost)[k] : 0.0); };
    double x1 = input(0), x2 = x1, y1 = x1, y2 = x1;
    for (std::size_t k = 0; k < f.size(); ++k) {
      const double x0 = input(k), y0 = (b0 * x0 + b1 * x1 + b2 * x2 - a1 * y1 - a2 * y2) / a0;
      f[k] = x0 - y0;
      x2 = x1; x1 = x0; y2 = y1; y1 = y0;
    }
  }, 0);
}

}  // namespace driveid::diagnose
