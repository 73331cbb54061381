// SPDX-License-Identifier: Apache-2.0
#include "diagnose/record_column.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace driveid::diagnose {
namespace {

constexpr double kTwoPi = 6.283185307179586;

}  // namespace

// Speed column against the derivative of the angle: sign, unit and lag.
void check_speed(Prepared &p, const std::string &pos, const std::string &vel) {
  double sxx = 0, sxy = 0, syy = 0;
  const int h = 5;
  std::vector<double> a, b, c;
  for (auto &piece : p.pieces) {
    const auto &x = piece.signal[pos], &v = piece.signal[vel];
    for (std::size_t k = 2 * h; k + 2 * h < piece.n; ++k) {
      double dx = 0, sv = 0;
      for (int j = 1; j <= h; ++j) dx += (x[k + std::size_t(j)] - x[k - std::size_t(j)]) * j;
      dx /= 110.0 * p.dt_s;   // 2 * (1+4+9+16+25)
      for (int j = -h; j <= h; ++j) sv += v[std::size_t(std::ptrdiff_t(k) + j)] * (h * h - j * j);
      sv /= 165.0;            // sum of 25 - j^2 over -5..5
      double acc = 0;
      for (int j = 1; j <= h; ++j) acc += (v[k + std::size_t(j)] - v[k - std::size_t(j)]) * j;
      acc /= 110.0 * p.dt_s;
      a.push_back(dx); b.push_back(sv); c.push_back(acc);
      sxx += dx * dx; sxy += dx * sv; syy += sv * sv;
    }
  }
  if (a.size() < 100 || !(sxx > 0) || !(syy > 0)) return;
  double correlation = sxy / std::sqrt(sxx * syy), ratio = sxy / sxx;
  if (std::fabs(correlation) < 0.7) {
    p.notices.push_back({"speed_mismatch", vel + " does not follow the derivative of " + pos + "; the angle alone is used", p.name});
    return;
  }
  if (ratio < 0) p.notices.push_back({"sign", vel + " has the opposite sign of the derivative of " + pos + ": map it with a minus sign", p.name});
  static const struct { double r; const char *what; } known[] = {
      {57.29578, "deg/s"}, {9.549297, "rpm"}, {1 / kTwoPi, "turns/s"}, {1000, "milli-units"}, {0.001, "kilo-units"}, {kTwoPi, "a factor 2 pi"}, {1 / 57.29578, "an angle in degrees"}};
  if (std::fabs(std::fabs(ratio) - 1) > 0.2) {
    std::string guess;
    for (auto &u : known)
      if (std::fabs(std::fabs(ratio) / u.r - 1) < 0.1) guess = std::string("; it looks like ") + u.what;
    p.notices.push_back({"units", vel + text(" is %.4g times the derivative of ", ratio) + pos + guess + ": state the unit in --map", p.name});
  }
  // sv = ratio * dx - lag * (its own slope)
  double s11 = 0, s12 = 0, s22 = 0, y1 = 0, y2 = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    s11 += a[k] * a[k]; s12 += a[k] * c[k]; s22 += c[k] * c[k];
    y1 += a[k] * b[k]; y2 += c[k] * b[k];
  }
  double det = s11 * s22 - s12 * s12;
  if (!(det > 1e-9 * s11 * s22)) return;
  p.speed_lag_s = (y1 * s12 - y2 * s11) / det;
  if (std::fabs(p.speed_lag_s) > 0.7 * p.dt_s)
    p.notices.push_back({"speed_lag", vel + text(" lags the derivative of the position by %.3g ms (%.1f samples); the position is used", 1e3 * p.speed_lag_s, p.speed_lag_s / p.dt_s), p.name});
}

}  // namespace driveid::diagnose
