// SPDX-License-Identifier: Apache-2.0
#include "diagnose/record.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>

namespace driveid::diagnose {
namespace {

constexpr double kTwoPi = 6.283185307179586;
constexpr std::size_t kRowsMax = 400000;  // rows kept for the analysis; longer records are sampled in stretches

double median_of(std::vector<double> v) {
  if (v.empty()) return 0;
  auto mid = v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2);
  std::nth_element(v.begin(), mid, v.end());
  return *mid;
}

bool is_position(const std::string &n) { return n == "theta_rad" || n == "x_m" || n.rfind("theta_", 0) == 0 || n.rfind("x_", 0) == 0; }

std::string text(const char *format, double a, double b = 0, double c = 0) {
  char buffer[256];
  std::snprintf(buffer, sizeof buffer, format, a, b, c);
  return buffer;
}

struct Raw {
  std::vector<double> t;
  std::map<std::string, std::vector<double>> column;
};

// Strictly increasing stamps; duplicates and steps back are dropped and counted.
Raw ordered(const driveid_record &r, std::vector<Notice> &notices) {
  Raw raw;
  std::vector<std::size_t> keep;
  std::size_t duplicates = 0, back = 0;
  std::int64_t last = 0;
  for (std::size_t k = 0; k < r.rows; ++k) {
    if (!keep.empty() && r.t_ns[k] <= last) {
      ++(r.t_ns[k] == last ? duplicates : back);
      continue;
    }
    last = r.t_ns[k];
    keep.push_back(k);
  }
  if (duplicates) notices.push_back({"duplicate", text("%.0f rows repeat the stamp before them and were dropped", double(duplicates)), ""});
  if (back) notices.push_back({"back_in_time", text("%.0f rows go back in time and were dropped", double(back)), ""});
  raw.t.reserve(keep.size());
  for (std::size_t k : keep) raw.t.push_back(1e-9 * double(r.t_ns[k] - r.t_ns[keep[0]]));
  for (std::size_t c = 0; c < r.columns; ++c) {
    auto &v = raw.column[r.column[c].name];
    v.reserve(keep.size());
    for (std::size_t k : keep) v.push_back(r.column[c].value[k]);
  }
  return raw;
}

// Value at x[2] predicted from its four neighbours (Lagrange), whose spacing may be uneven.
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

// Are the samples uniform in time although their stamps jitter? Whichever clock makes the signal smoother is believed.
bool uniform_clock_is_better(const std::vector<double> &t, const std::vector<double> &x) {
  std::vector<double> with_stamps, uniform;
  const double u[5] = {-2, -1, 0, 1, 2};
  for (std::size_t k = 2; k + 2 < t.size() && with_stamps.size() < 20000; ++k) {
    if (!(std::isfinite(x[k - 2]) && std::isfinite(x[k - 1]) && std::isfinite(x[k]) && std::isfinite(x[k + 1]) && std::isfinite(x[k + 2]))) continue;
    if (x[k - 2] == x[k + 2]) continue;
    with_stamps.push_back(std::fabs(x[k] - predict_middle(&t[k - 2], &x[k - 2])));
    uniform.push_back(std::fabs(x[k] - predict_middle(u, &x[k - 2])));
  }
  if (with_stamps.size() < 50) return false;
  double a = 0, b = 0, ca = median_of(with_stamps) * 20, cb = median_of(uniform) * 20;
  for (double e : with_stamps) a += std::min(e, ca) * std::min(e, ca);
  for (double e : uniform) b += std::min(e, cb) * std::min(e, cb);
  return b < 0.8 * a;
}

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
    if (jumps.size() < 3) return;      // one or two far jumps without a known period are glitches, not wraps
    period = range * (1 + 1.0 / double(x.size()));
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

// One wrong sample on a moving signal: it departs from the cubic through its neighbours, and all around nothing comes near that.
// What happens often is the drive's own (impacts, quantisation) and is left alone.
std::size_t mend_lone_samples(std::vector<double> &x, double scale) {
  const std::size_t n = x.size(), reach = 13, near = 3;
  std::vector<double> departure(n, 0.0);
  for (std::size_t k = 2; k + 2 < n; ++k) {
    const double d = x[k] - (4 * (x[k - 1] + x[k + 1]) - x[k - 2] - x[k + 2]) / 6;
    if (std::isfinite(d)) departure[k] = std::fabs(d);
  }
  std::vector<std::size_t> found;
  for (std::size_t k = 2; k + 2 < n; ++k) {
    if (departure[k] < 8 * scale || departure[k] < departure[k - 1] || departure[k] < departure[k + 1]) continue;
    const double left = x[k] - x[k - 1], right = x[k] - x[k + 1];
    if (left * right <= 0 || std::min(std::fabs(left), std::fabs(right)) < 0.5 * departure[k]) continue;
    double around = 0;
    for (std::size_t j = k > reach ? k - reach : 0; j < std::min(n, k + reach + 1); ++j)
      if (j + near <= k || j >= k + near) around = std::max(around, departure[j]);
    if (departure[k] > 6 * around) found.push_back(k);
  }
  if (found.size() > 12 && found.size() * 1000 > n) return 0;
  for (std::size_t k : found) x[k] = (4 * (x[k - 1] + x[k + 1]) - x[k - 2] - x[k + 2]) / 6;
  return found.size();
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

double interpolate(const std::vector<double> &t, const std::vector<double> &x, std::size_t k, double at, bool cubic) {
  // k: last index with t[k] <= at
  if (k + 1 >= t.size()) return x.back();
  double w = (at - t[k]) / (t[k + 1] - t[k]);
  if (w < 1e-9) return x[k];
  if (!cubic || k == 0 || k + 2 >= t.size()) return x[k] + w * (x[k + 1] - x[k]);
  double sum = 0;
  for (int i = -1; i <= 2; ++i) {
    double c = 1;
    for (int j = -1; j <= 2; ++j)
      if (j != i) c *= (at - t[k + std::size_t(j + 2) - 2]) / (t[k + std::size_t(i + 2) - 2] - t[k + std::size_t(j + 2) - 2]);
    sum += c * x[k + std::size_t(i + 2) - 2];
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

void notice_clipping(const std::vector<double> &x, const std::string &name, const SignalQuality &q, std::vector<Notice> &notices) {
  if (q.constant || x.size() < 200) return;
  for (int side = 0; side < 2; ++side) {
    double limit = side ? q.hi : q.lo;
    std::size_t at = 0, runs = 0;
    for (std::size_t k = 0; k < x.size(); ++k) {
      bool here = x[k] == limit;
      at += here;
      runs += here && k >= 2 && x[k - 1] == limit && x[k - 2] == limit;
    }
    if (at > x.size() / 100 && runs > at / 2 && q.quantum < 0.02 * (q.hi - q.lo) && limit != 0)
      notices.push_back({"clipped", name + text(" stands at its limit %.6g in %.1f %% of the rows: clipped or saturated", limit, 100.0 * double(at) / double(x.size())), ""});
  }
}

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
  // sv = ratio * (dx - lag * acc)
  double s11 = 0, s12 = 0, s22 = 0, y1 = 0, y2 = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    s11 += a[k] * a[k]; s12 += a[k] * c[k]; s22 += c[k] * c[k];
    y1 += a[k] * b[k]; y2 += c[k] * b[k];
  }
  double det = s11 * s22 - s12 * s12;
  if (!(det > 1e-9 * s11 * s22)) return;
  double g = (y1 * s22 - y2 * s12) / det, l = (y2 * s11 - y1 * s12) / det;
  p.speed_lag_s = g != 0 ? -l / g * std::copysign(1.0, ratio) * (ratio < 0 ? -1 : 1) : 0;
  if (std::fabs(p.speed_lag_s) > 0.7 * p.dt_s)
    p.notices.push_back({"speed_lag", vel + text(" lags the derivative of the position by %.3g ms (%.1f samples); the position is used", 1e3 * p.speed_lag_s, p.speed_lag_s / p.dt_s), p.name});
}

}  // namespace

Roles roles_of(const driveid_model &model, const Prepared &record) {
  Roles r;
  auto usable = [&](const char *n) {
    auto it = record.quality.find(n);
    return it != record.quality.end();
  };
  bool linear = model.structure == DRIVEID_STRUCTURE_LINEAR_AXIS;
  auto given = [&](const char *n) {
    for (unsigned k = 0; k < model.params; ++k)
      if (!std::strcmp(model.param[k].name, n) && model.param[k].state != DRIVEID_PARAM_UNSET) return model.param[k].value;
    return 0.0;
  };
  for (const char *n : {linear ? "x_m" : "theta_rad", linear ? "theta_rad" : "theta_m_rad", "x_m"})
    if (r.position.empty() && usable(n)) r.position = n;
  for (const char *n : {linear ? "v_m_s" : "omega_rad_s", linear ? "omega_rad_s" : "omega_m_rad_s", "v_m_s"})
    if (r.speed.empty() && usable(n)) r.speed = n;
  const char *direct = linear ? "F_N" : "tau_Nm";
  double gain = given(linear ? "K_F_N_A" : "K_t_Nm_A");
  const char *currents[2] = {model.structure == DRIVEID_STRUCTURE_PMSM_DRIVE ? "i_q_A" : "i_A", model.structure == DRIVEID_STRUCTURE_PMSM_DRIVE ? "i_A" : "i_q_A"};
  if (usable(direct)) r.input = direct;
  else
    for (const char *n : currents)
      if (r.input.empty() && usable(n)) r.input = n;
  if (r.input.empty() && model.structure == DRIVEID_STRUCTURE_DC_DRIVE && usable("v_V")) {
    r.input = "v_V";
    r.effort_unit = "V";
    return r;
  }
  if (r.input == direct) r.effort_unit = linear ? "N" : "N m";
  else if (gain != 0) r.input_gain = gain, r.effort_unit = linear ? "N" : "N m";
  else r.per_ampere = true, r.effort_unit = "A";
  return r;
}

Prepared prepare(const driveid_record &record, const driveid_model &model) {
  Prepared p;
  p.name = record.name ? record.name : "record";
  p.hash = record.hash ? record.hash : "";
  p.rows = record.rows;
  p.hold = record.hold ? record.hold : "";
  if (p.hold == "detect") p.hold.clear();
  if (record.rows < 50 || !record.t_ns) {
    p.bad = "the record has fewer than 50 rows: record at least some seconds of motion";
    return p;
  }
  Raw raw = ordered(record, p.notices);
  if (raw.t.size() < 50) {
    p.bad = "fewer than 50 rows have increasing stamps: check the time column";
    return p;
  }
  std::vector<double> dts;
  for (std::size_t k = 1; k < raw.t.size(); ++k) dts.push_back(raw.t[k] - raw.t[k - 1]);
  double dt = median_of(dts);
  std::vector<double> deviation;
  for (double d : dts)
    if (d < 1.5 * dt) deviation.push_back(std::fabs(d - dt));
  double jitter = median_of(deviation) / dt;
  p.span_s = raw.t.back();

  for (auto &[name, x] : raw.column) {
    std::size_t missing = 0;
    for (double v : x) missing += !std::isfinite(v);
    if (missing == x.size()) continue;
    if (missing) {
      p.notices.push_back({"missing_values", name + text(": %.0f values are missing", double(missing)), p.name});
      fill_missing(x);
    }
    if (is_position(name)) unwrap(x, name, p.notices);
    if (name != "T_degC") mend_glitches(x, name, p.notices);
  }
  for (auto it = raw.column.begin(); it != raw.column.end();)
    it = std::isfinite(it->second[0]) && std::isfinite(it->second[it->second.size() / 2]) ? std::next(it) : raw.column.erase(it);

  // The clock: stamps as they are, or a uniform clock behind jittering stamps.
  bool uniform = jitter < 0.02;
  std::string smooth;
  for (const char *n : {"theta_rad", "x_m", "omega_rad_s", "v_m_s", "i_A", "i_q_A", "y"})
    if (smooth.empty() && raw.column.count(n)) smooth = n;
  if (!uniform && jitter < 0.3 && !smooth.empty() && uniform_clock_is_better(raw.t, raw.column[smooth])) {
    uniform = true;
    p.notices.push_back({"jitter", text("stamps jitter by %.1f %% of the sample time while the samples are uniform: a uniform clock is used", 100 * jitter), p.name});
  } else if (!uniform) {
    p.notices.push_back({"uneven", text("sampling is uneven (median step %.4g ms, typical deviation %.1f %%): resampled on its own stamps", 1e3 * dt, 100 * jitter), p.name});
  }
  // A mean step over undisturbed steps is sharper than the median of quantised stamps.
  double sum = 0;
  std::size_t count = 0;
  for (double d : dts)
    if (d < 1.5 * dt && d > 0.5 * dt) sum += d, ++count;
  if (count && uniform) dt = sum / double(count);
  p.dt_s = dt;

  // Pieces: a gap of more than 12 samples, or 0.2 s where the rate is low, ends a piece.
  std::vector<double> t = raw.t;
  std::vector<std::size_t> start{0};
  std::size_t lost = 0, gaps = 0;
  for (std::size_t k = 1; k < t.size(); ++k) {
    double step = (raw.t[k] - raw.t[k - 1]) / dt;
    if (step > 12.5) start.push_back(k), ++gaps;
    else if (step > 1.6 && uniform) lost += std::size_t(std::lround(step)) - 1;
    if (uniform && step <= 12.5) t[k] = t[k - 1] + dt * std::max(1.0, std::round(step));
    else t[k] = uniform ? raw.t[k] : t[k];
  }
  if (lost) p.notices.push_back({"lost_rows", text("%.0f rows are lost in short gaps; they were interpolated", double(lost)), p.name});
  if (gaps) p.notices.push_back({"gap", text("%.0f gaps split the record; each stretch starts anew", double(gaps)), p.name});
  start.push_back(t.size());
  std::size_t total = 0;
  for (std::size_t s = 0; s + 1 < start.size(); ++s) {
    std::size_t a = start[s], b = start[s + 1];
    if (b - a < 40) continue;
    Piece piece;
    piece.t0_s = t[a];
    std::vector<double> tt(t.begin() + std::ptrdiff_t(a), t.begin() + std::ptrdiff_t(b));
    piece.n = std::size_t(std::floor((tt.back() - tt[0]) / dt + 1e-6)) + 1;
    piece.filled.assign(piece.n, 0);
    std::vector<std::size_t> index(piece.n);
    for (std::size_t k = 0, j = 0; k < piece.n; ++k) {
      double at = tt[0] + double(k) * dt;
      while (j + 1 < tt.size() && tt[j + 1] <= at + 1e-7 * dt) ++j;
      index[k] = j;
      piece.filled[k] = at - tt[j] > 0.5 * dt && uniform;
    }
    for (auto &[name, x] : raw.column) {
      std::vector<double> xx(x.begin() + std::ptrdiff_t(a), x.begin() + std::ptrdiff_t(b));
      auto &out = piece.signal[name];
      out.resize(piece.n);
      bool cubic = is_position(name) || name == "omega_rad_s" || name == "v_m_s";
      for (std::size_t k = 0; k < piece.n; ++k) {
        double at = std::min(tt[0] + double(k) * dt, tt.back());
        out[k] = interpolate(tt, xx, index[k], std::max(at, tt[index[k]]), cubic);
      }
    }
    total += piece.n;
    p.pieces.push_back(std::move(piece));
  }
  if (total > kRowsMax) {   // keep evenly spread stretches of 20,000 rows
    std::size_t stretch = 20000, wanted = kRowsMax / stretch;
    std::vector<Piece> kept;
    double spacing = double(total) / double(wanted), next = 0, seen = 0;
    for (auto &piece : p.pieces) {
      for (; next < seen + double(piece.n); next += spacing) {
        std::size_t a = std::size_t(std::max(0.0, next - seen)), b = std::min(piece.n, a + stretch);
        if (b - a < 400) continue;
        Piece cut;
        cut.t0_s = piece.t0_s + double(a) * dt;
        cut.n = b - a;
        for (auto &[name, x] : piece.signal) cut.signal[name].assign(x.begin() + std::ptrdiff_t(a), x.begin() + std::ptrdiff_t(b));
        cut.filled.assign(piece.filled.begin() + std::ptrdiff_t(a), piece.filled.begin() + std::ptrdiff_t(b));
        kept.push_back(std::move(cut));
      }
      seen += double(piece.n);
    }
    p.pieces = std::move(kept);
    p.notices.push_back({"long", text("the record has %.0f rows; %.0f stretches of %.0f rows spread over it are analysed", double(total), double(p.pieces.size()), double(stretch)), p.name});
  }
  if (p.pieces.empty()) {
    p.bad = "no stretch of 40 rows without a gap: record without interruptions";
    return p;
  }
  for (auto &[name, x] : raw.column) {
    (void)x;
    std::vector<double> joined;
    for (auto &piece : p.pieces) {
      const auto &v = piece.signal[name];
      joined.insert(joined.end(), v.begin(), v.end());
      if (joined.size() > 300000) break;
    }
    SignalQuality q = quality_of(joined);
    if (q.constant) {
      static const char *known[] = {"theta_rad", "x_m", "omega_rad_s", "v_m_s", "i_A", "i_q_A", "tau_Nm", "F_N", "v_V", "v_q_V"};
      for (const char *k : known)
        if (name == k) p.notices.push_back({"constant", name + " never changes: the column carries no information", p.name});
    } else {
      notice_clipping(joined, name, q, p.notices);
    }
    p.quality[name] = q;
  }
  Roles roles = roles_of(model, p);
  if (!roles.position.empty() && !roles.speed.empty()) check_speed(p, roles.position, roles.speed);
  for (auto &n : p.notices)
    if (n.record.empty()) n.record = p.name;
  return p;
}

}  // namespace driveid::diagnose
