// SPDX-License-Identifier: Apache-2.0
#include "diagnose/record_column.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace driveid::diagnose {
namespace {

constexpr double kTwoPi = 6.283185307179586;

}  // namespace

double median_of(std::vector<double> v) {
  if (v.empty()) return 0;
  auto mid = v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2);
  std::nth_element(v.begin(), mid, v.end());
  return *mid;
}

bool is_position(const std::string &n) { return n == "theta_rad" || n == "x_m" || n.rfind("theta_", 0) == 0 || n.rfind("x_", 0) == 0; }

std::string text(const char *format, double a, double b, double c) {
  char buffer[256];
  std::snprintf(buffer, sizeof buffer, format, a, b, c);
  return buffer;
}

double predict_middle(const double *t, const double *x) {
  double sum = 0;
  for (int i = 0; i < 5; ++i) {
    if (i == 2) continue;
    double w = 1;
    for (int j = 0; j < 5; ++j)
      if (j != 2 && j != i) w *= (t[2] - t[j]) / (t[i] - t[j]);
    sum += w * x[i];
  }
  return sum;
}

void fill_missing(std::vector<double> &x) {
  std::size_t k = 0, n = x.size();
  while (k < n) {
    if (std::isfinite(x[k])) { ++k; continue; }
    std::size_t a = k;
    while (k < n && !std::isfinite(x[k])) ++k;
    double left = a ? x[a - 1] : (k < n ? x[k] : 0), right = k < n ? x[k] : left;
    for (std::size_t j = a; j < k; ++j) x[j] = left + (right - left) * double(j - a + 1) / double(k - a + 1);
  }
}

namespace {

// A wrap at a degree's, a turn's or a counter's period, where the range comes within a hundredth of it; else what the range says.
double wrap_period(double range, double seen) {
  for (double known : {1.0, 360.0, 4000.0, 10000.0})
    if (range <= known && range > 0.99 * known) return known;
  const double power = std::exp2(std::ceil(std::log2(range)));
  return power >= 256 && power <= 4294967296.0 && range > 0.99 * power ? power : seen;
}

void notice_wrap_unit(const std::string &name, double period, std::vector<Notice> &notices) {
  if (name.rfind("theta", 0) != 0) return;
  const char *unit = period == 360 ? "degrees, map it with :deg" : period == 1 ? "turns, map it with :turns" : period == std::floor(period) ? "counts of an encoder, map it with :counts/N" : "another unit, state it in --map";
  notices.push_back({"units", name + text(" wraps at %.6g and not at a turn's 6.283 rad: it looks like ", period) + unit, ""});
}

// Steps that are large against the range and every other of them back: a sensor's noise, no turning.
bool is_noise(const std::vector<double> &x, double range) {
  std::vector<double> size;
  double last = NAN, before = 0;
  std::size_t turns = 0;
  for (double v : x) {
    if (!std::isfinite(v)) continue;
    if (std::isfinite(last) && v != last) {
      const double step = v - last;
      turns += step * before < 0;
      size.push_back(std::fabs(step));
      before = step;
    }
    last = v;
  }
  return 2 * turns > size.size() && median_of(size) > 0.02 * range;
}

}  // namespace

void unwrap(std::vector<double> &x, const std::string &name, std::vector<Notice> &notices) {
  double lo = INFINITY, hi = -INFINITY;
  for (double v : x)
    if (std::isfinite(v)) lo = std::min(lo, v), hi = std::max(hi, v);
  double range = hi - lo;
  if (!(range > 0)) return;
  std::vector<double> jumps;
  double last = NAN;
  for (double v : x) {
    if (!std::isfinite(v)) continue;
    if (std::isfinite(last) && std::fabs(v - last) > 0.6 * range) jumps.push_back(std::fabs(v - last));
    last = v;
  }
  if (jumps.empty()) return;
  double period = kTwoPi;
  if (name.rfind("theta", 0) != 0 || range > 1.02 * kTwoPi || range < 0.55 * kTwoPi) {
    if (jumps.size() < 3 || is_noise(x, range)) return;      // one or two far jumps without a known period are glitches, not wraps
    period = wrap_period(range, range * (1 + 1.0 / double(x.size())));
    notice_wrap_unit(name, period, notices);
  }
  double shift = 0;
  std::size_t wraps = 0;
  last = NAN;
  for (double &v : x) {
    if (!std::isfinite(v)) continue;
    double raw = v;
    if (std::isfinite(last)) {
      double step = raw - last;
      if (std::fabs(step) > 0.5 * period) shift -= period * std::round(step / period), ++wraps;
    }
    last = raw;
    v = raw + shift;
  }
  if (wraps) notices.push_back({"unwrapped", name + text(" wraps at %.6g; unwrapped %.0f times", period, double(wraps)), ""});
}

namespace {

// One wrong sample on a moving signal: it departs from the cubic through its neighbours, and all around nothing comes near that.
// What happens often is the drive's own (impacts, quantisation) and is left alone.
std::size_t mend_lone_samples(std::vector<double> &x, double scale) {
  const std::size_t n = x.size(), reach = 13, near = 3;
  std::vector<double> departure(n, 0.0);
  for (std::size_t k = 2; k + 2 < n; ++k) {
    const double d = x[k] - (4 * (x[k - 1] + x[k + 1]) - x[k - 2] - x[k + 2]) / 6;
    if (std::isfinite(d)) departure[k] = std::fabs(d);
  }
  std::vector<std::size_t> peak, found;
  for (std::size_t k = 2; k + 2 < n; ++k) {
    if (departure[k] < 8 * scale || departure[k] < departure[k - 1] || departure[k] < departure[k + 1]) continue;
    const double left = x[k] - x[k - 1], right = x[k] - x[k + 1];
    if (left * right > 0 && std::min(std::fabs(left), std::fabs(right)) >= 0.5 * departure[k]) peak.push_back(k);
  }
  for (std::size_t k : peak) {
    const auto from = std::lower_bound(peak.begin(), peak.end(), k > reach + near ? k - reach - near : 0), to = std::upper_bound(from, peak.end(), k + reach + near);
    const bool few = to - from <= 3;   // two or three wrong samples may fall close together
    double around = 0;
    for (std::size_t j = k > reach ? k - reach : 0; j < std::min(n, k + reach + 1); ++j) {
      const bool of_a_peak = std::any_of(from, to, [&](std::size_t p) { return (few || p == k) && j + near > p && j < p + near; });
      if (!of_a_peak) around = std::max(around, departure[j]);
    }
    if (departure[k] > 6 * around) found.push_back(k);
  }
  if (found.size() > 12 && found.size() * 1000 > n) return 0;
  for (std::size_t k : found) x[k] = (4 * (x[k - 1] + x[k + 1]) - x[k - 2] - x[k + 2]) / 6;
  std::size_t ends = 0;
  for (int side = 0; side < 2 && n > 2 * reach; ++side) {   // the first and the last row have neighbours on one side only
    const auto at = [&](std::size_t j) -> double & { return x[side ? n - 1 - j : j]; };
    double around = 0;
    for (std::size_t j = 1; j < reach; ++j) around = std::max(around, std::fabs(at(j) - 2 * at(j + 1) + at(j + 2)));
    const double from = std::fabs(at(0) - 2 * at(1) + at(2));
    if (from > 20 * scale && from > 6 * around) at(0) = 2 * at(1) - at(2), ++ends;
  }
  return found.size() + ends;
}

}  // namespace

// A current loop answers a step with a pulse of voltage of one sample: what the drive applies elsewhere too is no wrong reading.
std::size_t restore_usual(std::vector<double> &x, const std::vector<double> &read) {
  std::vector<double> sorted;
  for (double v : read)
    if (std::isfinite(v)) sorted.push_back(v);
  std::sort(sorted.begin(), sorted.end());
  const std::size_t rare = 3 + sorted.size() / 200;
  if (sorted.size() <= 2 * rare) return 0;
  const double lo = sorted[rare], hi = sorted[sorted.size() - 1 - rare];
  std::size_t restored = 0;
  for (std::size_t k = 0; k < x.size(); ++k)
    if (x[k] != read[k] && read[k] > lo && read[k] < hi) x[k] = read[k], ++restored;
  return restored;
}

// Isolated spikes far outside the range of their neighbourhood become the mean of their neighbours.
void mend_glitches(std::vector<double> &x, const std::string &name, std::vector<Notice> &notices) {
  const std::size_t n = x.size();
  if (n < 60) return;
  std::vector<double> diffs;
  for (std::size_t k = 1; k < n; ++k)
    if (std::isfinite(x[k]) && std::isfinite(x[k - 1])) diffs.push_back(std::fabs(x[k] - x[k - 1]));
  double scale = 1.5 * median_of(diffs);
  if (scale <= 0) {
    std::vector<double> moving;
    for (double d : diffs)
      if (d > 0) moving.push_back(d);
    scale = median_of(moving);
  }
  if (scale <= 0) return;
  const std::vector<double> read = x;
  std::size_t mended = mend_lone_samples(x, scale);
  for (std::size_t k = 1; k + 1 < n; ++k) {
    for (std::size_t width = 1; width <= 2 && k + width < n; ++width) {
      double left = x[k - 1], right = x[k + width];
      if (!std::isfinite(left) || !std::isfinite(right) || !std::isfinite(x[k])) continue;
      double d1 = x[k] - left, d2 = x[k + width - 1] - right;
      if (d1 * d2 <= 0) continue;
      double jump = std::min(std::fabs(d1), std::fabs(d2));
      if (jump < 10 * scale || jump < 4 * std::fabs(right - left)) continue;
      double lo = INFINITY, hi = -INFINITY;
      std::size_t a = k > 13 ? k - 13 : 0, b = std::min(n, k + width + 13);
      for (std::size_t j = a; j < b; ++j)
        if ((j < k || j >= k + width) && std::isfinite(x[j])) lo = std::min(lo, x[j]), hi = std::max(hi, x[j]);
      double out = std::max(x[k] - hi, lo - x[k]);
      if (out < 1.5 * (hi - lo) || out < 8 * scale) continue;
      for (std::size_t j = 0; j < width; ++j) x[k + j] = left + (right - left) * double(j + 1) / double(width + 1);
      ++mended;
      break;
    }
  }
  if (name.starts_with("v_") && name.ends_with("_V")) mended -= std::min(mended, restore_usual(x, read));
  if (mended && mended * 20 < n)
    notices.push_back({"glitch", name + text(": %.0f isolated spikes were replaced by their neighbours", double(mended)), ""});
}

SignalQuality quality_of(const std::vector<double> &x) {
  SignalQuality q;
  std::vector<double> residual, steps;
  q.lo = INFINITY;
  q.hi = -INFINITY;
  const double u[5] = {-2, -1, 0, 1, 2};
  for (std::size_t k = 0; k < x.size(); ++k) {
    q.lo = std::min(q.lo, x[k]);
    q.hi = std::max(q.hi, x[k]);
    if (k >= 2 && k + 2 < x.size()) residual.push_back(std::fabs(x[k] - predict_middle(u, &x[k - 2])));
    if (k && x[k] != x[k - 1] && steps.size() < 200000) steps.push_back(std::fabs(x[k] - x[k - 1]));
  }
  q.constant = !(q.hi - q.lo > 1e-12 * std::max(1.0, std::fabs(q.hi)));
  if (residual.empty()) return q;
  double rms = 0, cut = 6 * median_of(residual) + 1e-300;
  std::size_t kept = 0;
  for (double e : residual)
    if (e < cut) rms += e * e, ++kept;
  q.noise = kept ? std::sqrt(rms / double(kept) / (1 + 34.0 / 36.0)) : 0;
  if (steps.size() > 20) {   // quantised where every step is a whole multiple of the smallest common one
    std::sort(steps.begin(), steps.end());
    double step = steps[steps.size() / 50];
    double sum = 0;
    std::size_t count = 0, whole = 0;
    for (double s : steps) {
      double ratio = s / step;
      if (ratio > 40) break;
      if (std::fabs(ratio - std::round(ratio)) < 0.05) ++whole;
      if (std::round(ratio) == 1) sum += s, ++count;
    }
    std::size_t tested = 0;
    for (double s : steps) tested += s / step <= 40;
    if (count && tested && whole > 0.97 * double(tested)) q.quantum = sum / double(count);
  }
  if (q.quantum > 0) q.noise = std::max(q.noise, q.quantum / std::sqrt(12.0));
  return q;
}

namespace {

// A position stands at its extremes wherever the axis turns or rests there; it is cut off only where it runs into them at speed.
bool runs_into(const std::vector<double> &x, double limit, double quantum) {
  double moved = 0;
  for (std::size_t k = 1; k < x.size(); ++k) moved += (x[k] - x[k - 1]) * (x[k] - x[k - 1]);
  const double fast = std::max(2 * quantum, 0.3 * std::sqrt(moved / double(x.size())));
  std::size_t entries = 0, hard = 0;
  for (std::size_t k = 2; k < x.size(); ++k)
    if (x[k] == limit && x[k - 1] != limit) ++entries, hard += std::fabs(x[k - 1] - x[k - 2]) > fast;
  return 2 * hard > entries;
}

}  // namespace

namespace {

struct Standing { std::size_t rows = 0, in_runs = 0; };

Standing standing(const std::vector<double> &x, double limit) {
  Standing s;
  for (std::size_t k = 0; k < x.size(); ++k) {
    const bool here = x[k] == limit;
    s.rows += here;
    s.in_runs += here && ((k && x[k - 1] == limit) || (k + 1 < x.size() && x[k + 1] == limit));
  }
  return s;
}

}  // namespace

void notice_clipping(const std::vector<double> &x, const std::string &name, SignalQuality &q, std::vector<Notice> &notices) {
  if (q.constant || x.size() < 200 || q.quantum >= 0.02 * (q.hi - q.lo)) return;
  const Standing at[2] = {standing(x, q.lo), standing(x, q.hi)};
  const bool alike = q.lo == -q.hi;   // a sensor's range: both of its ends count
  for (int side = 0; side < 2; ++side) {
    const double limit = side ? q.hi : q.lo;
    if (is_position(name) && !runs_into(x, limit, q.quantum)) continue;
    const std::size_t rows = at[side].rows + (alike ? at[1 - side].rows : 0);
    if (!(rows > x.size() / 100 && at[side].in_runs > at[side].rows / 2 && limit != 0)) continue;
    q.clipped[side] = true;
    notices.push_back({"clipped", name + text(" stands at its limit %.6g in %.1f %% of the rows: clipped or saturated", limit, 100.0 * double(at[side].rows) / double(x.size())), ""});
  }
}

void notice_steps(const std::string &name, const SignalQuality &q, std::vector<Notice> &notices) {
  if (q.constant || !(q.quantum > 0)) return;
  if (is_position(name) && std::fabs(q.quantum - 1) < 1e-9 && q.hi - q.lo > 50)
    notices.push_back({"units", name + " holds whole numbers: it looks like counts of an encoder; state the unit in --map (:counts/N, N counts a turn)", ""});
  else if (q.quantum > 1.5 * q.noise && name.rfind("theta", 0) == 0)
    notices.push_back({"quantised", name + text(" comes in steps of %.3g rad (%.0f a turn)", q.quantum, kTwoPi / q.quantum), ""});
  else if (q.quantum > 1.5 * q.noise)
    notices.push_back({"quantised", name + text(" comes in steps of %.3g", q.quantum), ""});
}

}  // namespace driveid::diagnose
