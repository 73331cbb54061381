// SPDX-License-Identifier: Apache-2.0
#include "diagnose/locate.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>

namespace driveid::diagnose {
namespace {

constexpr double kTwoPi = 6.283185307179586;
constexpr int kMostOrders = 60;
constexpr std::size_t kStretch = 50;   // rows: longer than what the kernel correlates

std::string say(const char *format, double a = 0, double b = 0) {
  char buffer[160];
  std::snprintf(buffer, sizeof buffer, format, a, b);
  return buffer;
}

struct Rows {
  std::vector<const driveid_effect_state *> state;
  std::vector<double> gain;     // removable squared error of each row
  double total = 0;
};

double quantile(std::vector<double> v, double q) {
  if (v.empty()) return 0;
  auto at = v.begin() + std::ptrdiff_t(q * double(v.size() - 1));
  std::nth_element(v.begin(), at, v.end());
  return *at;
}

Regime weigh(const Rows &rows, const std::vector<unsigned char> &inside, std::string axis, std::string text, double lo, double hi) {
  Regime r{std::move(axis), std::move(text), lo, hi, 0, 0, 0, 0, false};
  double in = 0, count = 0;
  for (std::size_t k = 0; k < rows.gain.size(); ++k)
    if (inside[k]) in += rows.gain[k], count += 1;
  const double n = double(rows.gain.size());
  r.rows = count / n;
  r.share = rows.total != 0 ? in / rows.total : 0;
  if (count < 20 || n - count < 20) return r;
  // excess of the regime, stretch by stretch: sum over rows of (inside - share of rows) * gain
  double sum = 0, square = 0;
  for (std::size_t a = 0; a < rows.gain.size(); a += kStretch) {
    double s = 0;
    for (std::size_t k = a; k < std::min(rows.gain.size(), a + kStretch); ++k) s += (inside[k] ? 1 - r.rows : -r.rows) * (rows.gain[k] - rows.total / n);
    sum += s;
    square += s * s;
  }
  r.statistic = square > 0 ? sum / std::sqrt(square) : 0;
  return r;
}

void turn_harmonics(const Equation &e, const Eigen::VectorXd &residual, const Rows &rows, std::vector<Regime> &out) {
  std::vector<OrderLine> lines = order_lines(e, residual);
  for (std::size_t k = 0; k < std::min<std::size_t>(3, lines.size()); ++k) {
    Regime r;
    r.axis = "turn";
    r.text = say("%.0f periods per turn", lines[k].order);
    r.lo = r.hi = lines[k].order;
    r.share = rows.total > 0 ? std::clamp(lines[k].power / rows.total, 0.0, 1.0) : 0;
    r.rows = 1;
    r.statistic = lines[k].statistic;
    out.push_back(r);
  }
}

}  // namespace

std::vector<OrderLine> order_lines(const Equation &e, const Eigen::VectorXd &residual) {
  std::vector<double> angle;
  double lo = INFINITY, hi = -INFINITY;
  for (const Track &t : e.tracks)
    for (int c : t.row) angle.push_back(t.state[std::size_t(c)].angle), lo = std::min(lo, angle.back()), hi = std::max(hi, angle.back());
  const bool rotary = e.frame != DRIVEID_FRAME_FORCE && e.frame != DRIVEID_FRAME_AMPERE_LINEAR;
  std::vector<OrderLine> lines;
  if (e.electrical || !rotary || hi - lo < 1.5 * kTwoPi) return lines;
  for (int order = 1; order <= kMostOrders; ++order) {
    double c = 0, s = 0, v = 0;
    for (std::size_t a = 0; a < angle.size(); a += kStretch) {
      double bc = 0, bs = 0;
      for (std::size_t k = a; k < std::min(angle.size(), a + kStretch); ++k) {
        bc += residual[Eigen::Index(k)] * std::cos(order * angle[k]);
        bs += residual[Eigen::Index(k)] * std::sin(order * angle[k]);
      }
      c += bc; s += bs; v += bc * bc + bs * bs;
    }
    lines.push_back({double(order), 2 * (c * c + s * s) / double(angle.size()), v > 0 ? std::sqrt(2 * (c * c + s * s) / v) : 0});
  }
  std::sort(lines.begin(), lines.end(), [](const OrderLine &a, const OrderLine &b) { return a.power > b.power; });
  return lines;
}

std::vector<Regime> locate(const Equation &e, const Eigen::VectorXd &residual, const Eigen::VectorXd &floor) {
  Rows rows;
  std::vector<double> since;   // s since the last change of direction
  for (const Track &t : e.tracks) {
    std::vector<double> age(t.state.size(), 1e9);
    double last = -1e9;
    for (std::size_t k = 1; k < t.state.size(); ++k) {
      if ((t.state[k].speed > 0) != (t.state[k - 1].speed > 0)) last = t.state[k].t_s;
      age[k] = t.state[k].t_s - last;
    }
    for (int c : t.row) rows.state.push_back(&t.state[std::size_t(c)]), since.push_back(age[std::size_t(c)]);
  }
  for (std::size_t k = 0; k < e.rows; ++k) {
    double g = residual[Eigen::Index(k)] * residual[Eigen::Index(k)] - floor[Eigen::Index(k)] * floor[Eigen::Index(k)];
    rows.gain.push_back(g);
    rows.total += g;
  }
  std::vector<Regime> out;
  if (rows.gain.size() < 100 || !(rows.total > 0)) return out;
  auto by = [&](const char *axis, const std::function<double(const driveid_effect_state &)> &of, const char *unit, const char *name, int bins) {
    std::vector<double> v;
    for (const auto *s : rows.state) v.push_back(of(*s));
    double lo = quantile(v, 0), hi = quantile(v, 1);
    if (!(hi - lo > 1e-9 * std::max(std::fabs(hi), std::fabs(lo)))) return;
    for (int b = 0; b < bins; ++b) {
      double a = b ? quantile(v, double(b) / bins) : lo, z = b + 1 < bins ? quantile(v, double(b + 1) / bins) : hi;
      std::vector<unsigned char> inside(v.size());
      for (std::size_t k = 0; k < v.size(); ++k) inside[k] = v[k] >= a && (v[k] < z || b + 1 == bins);
      char text[200];
      std::snprintf(text, sizeof text, "%s from %.4g to %.4g %s", name, a, z, unit);
      out.push_back(weigh(rows, inside, axis, text, a, z));
    }
  };
  const bool linear = e.frame == DRIVEID_FRAME_FORCE || e.frame == DRIVEID_FRAME_AMPERE_LINEAR;
  const char *w = linear ? "m/s" : "rad/s", *x = linear ? "m" : "rad", *acc = linear ? "m/s^2" : "rad/s^2", *drive = e.drive_unit == 'A' ? "A" : e.drive_unit == 'V' ? "V" : linear ? "N" : "N m";
  by("speed", [](const driveid_effect_state &s) { return std::fabs(s.speed); }, w, "speed", 4);
  {
    std::vector<unsigned char> forward, near;
    for (std::size_t k = 0; k < rows.state.size(); ++k) forward.push_back(rows.state[k]->speed > 0), near.push_back(since[k] < 0.1);
    out.push_back(weigh(rows, forward, "direction", "forward", 0, 0));
    for (auto &f : forward) f = !f;
    out.push_back(weigh(rows, forward, "direction", "backward", 0, 0));
    out.push_back(weigh(rows, near, "reversal", "within 0.1 s after a change of direction", 0, 0.1));
  }
  by("acceleration", [](const driveid_effect_state &s) { return std::fabs(s.accel); }, acc, "acceleration", 3);
  by("position", [](const driveid_effect_state &s) { return s.angle; }, x, "position", 5);
  if (e.electrical) by("current", [](const driveid_effect_state &s) { return std::fabs(s.current_A); }, "A", "current", 3);
  else by("drive", [](const driveid_effect_state &s) { return std::fabs(s.drive); }, drive, "driving channel", 3);
  if (e.tracks[0].state[0].has_temperature) by("temperature", [](const driveid_effect_state &s) { return s.T_degC; }, "degC", "temperature", 3);
  by("time", [](const driveid_effect_state &s) { return s.t_s; }, "s", "time", 4);
  if (!e.electrical) turn_harmonics(e, residual, rows, out);
  {   // slow and fast parts of the residual: a running mean over about 0.2 s
    const double step = e.tracks[0].row.size() > 1 ? (e.tracks[0].row[1] - e.tracks[0].row[0]) * e.tracks[0].dt_s : 0.01;
    const std::ptrdiff_t half = std::max<std::ptrdiff_t>(1, std::ptrdiff_t(0.1 / step));
    double slow = 0, all = 0;
    const std::ptrdiff_t n = std::ptrdiff_t(e.rows);
    double sum = 0;
    std::ptrdiff_t a = 0, b = 0;
    for (std::ptrdiff_t k = 0; k < n; ++k) {
      while (b < std::min(n, k + half + 1)) sum += residual[b++];
      while (a < k - half) sum -= residual[a++];
      double m = sum / double(b - a);
      slow += m * m;
      all += residual[k] * residual[k];
    }
    Regime r;
    r.axis = "frequency";
    r.text = say("slower than %.2g Hz", 0.5 / (double(half) * step));
    r.hi = 0.5 / (double(half) * step);
    r.share = all > 0 ? slow / all : 0;
    r.rows = 1;
    out.push_back(r);
  }
  // Bonferroni over the regimes at 1 %, two-sided, normal
  const double bound = 2.6 + 0.55 * std::log10(std::max<double>(1, double(out.size()))) * 1.3;
  for (Regime &r : out) {
    r.bound = bound;
    r.significant = r.axis == "frequency" ? false : r.statistic > bound;
    r.share = std::max(0.0, r.share);
  }
  std::stable_sort(out.begin(), out.end(), [](const Regime &p, const Regime &q) {
    if (p.significant != q.significant) return p.significant;
    return p.share - (p.significant ? p.rows : 0) > q.share - (q.significant ? q.rows : 0);
  });
  return out;
}

}  // namespace driveid::diagnose
