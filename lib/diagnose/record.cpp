// SPDX-License-Identifier: Apache-2.0
#include "diagnose/record.hpp"
#include "diagnose/record_column.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>

namespace driveid::diagnose {
namespace {

constexpr std::size_t kRowsMax = 400000;  // rows kept for the analysis; longer records are sampled in stretches

constexpr double kClockFollows = 0.02;    // how fast a uniform clock follows slow drift of the stamps
constexpr double kSlowest_s = 0.5;        // rows further apart than this are no record of a drive in motion

struct Raw {
  std::vector<double> t;
  std::map<std::string, std::vector<double>> column;
};

// Strictly increasing stamps; duplicates and steps back are dropped and counted.
Raw ordered(driveid_record r, std::vector<Notice> &notices) {
  Raw raw;
  const std::vector<std::int64_t> spread = spread_stamps(r, notices);
  if (!spread.empty()) r.t_ns = spread.data();
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

// How late the stamp of a row is against the uniform clock that its next fifty agree on.
double lateness(const std::vector<double> &t, std::size_t from, double dt) {
  double re = 0, im = 0;
  for (std::size_t k = from; k < std::min(t.size(), from + 50); ++k) {
    const double phase = 2 * 3.14159265358979 * (t[k] - t[from]) / dt;
    re += std::cos(phase);
    im += std::sin(phase);
  }
  return -std::atan2(im, re) * dt / (2 * 3.14159265358979);
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

}  // namespace

Piece Piece::part(std::size_t from, std::size_t to, double dt_s) const {
  const auto a = std::ptrdiff_t(from), b = std::ptrdiff_t(to);
  Piece cut;
  cut.t0_s = t0_s + double(from) * dt_s;
  cut.n = to - from;
  for (const auto &[name, x] : signal) cut.signal[name].assign(x.begin() + a, x.begin() + b);
  cut.filled.assign(filled.begin() + a, filled.begin() + b);
  return cut;
}

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

  if (dt > kSlowest_s) p.notices.push_back({"units", text("rows are %.3g s apart over %.3g s: a drive's record has many rows a second; is the time column in milliseconds?", dt, p.span_s), p.name});

  // Pieces: a gap of more than 12 samples, or 0.2 s where the rate is low, ends a piece.
  std::vector<double> t = raw.t;
  std::vector<std::size_t> start{0};
  std::size_t lost = 0, gaps = 0;
  double late = 0;   // of the stamps against the uniform clock, on average
  if (uniform) t[0] -= lateness(raw.t, 0, dt);
  for (std::size_t k = 1; k < t.size(); ++k) {
    const bool gap = (raw.t[k] - raw.t[k - 1]) / dt > 12.5;
    if (gap) start.push_back(k), ++gaps;
    if (!uniform) continue;
    if (gap) {
      t[k] = raw.t[k] - lateness(raw.t, k, dt);
      late = 0;
      continue;
    }
    const double steps = std::max(1.0, std::round((raw.t[k] - late - t[k - 1]) / dt));
    lost += std::size_t(steps) - 1;
    t[k] = t[k - 1] + dt * steps;
    late += kClockFollows * (raw.t[k] - t[k] - late);
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
        kept.push_back(piece.part(a, b, dt));
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
  for (const auto &column : raw.column) {
    const std::string &name = column.first;
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
      notice_steps(name, q, p.notices);
    }
    p.quality[name] = q;
  }
  notice_unused(p, model);
  take_out_clipped(p, model);
  Roles roles = roles_of(model, p);
  if (!roles.position.empty() && !roles.speed.empty()) check_speed(p, roles.position, roles.speed);
  if (roles.position.empty() && !roles.speed.empty())
    if (const double ratio = filter_ratio(p, roles.speed); ratio > 0) {
      undo_filter(p, roles.speed, ratio);
      p.quality[roles.speed] = quality_of(p.pieces[0].signal[roles.speed]);
      p.notices.push_back({"lag", roles.speed + text(" is differenced and filtered: it lags by %.2f ms; the filter was undone", 1e3 * p.dt_s * ratio / (1 - ratio)), p.name});
    }
  for (auto &n : p.notices)
    if (n.record.empty()) n.record = p.name;
  return p;
}

}  // namespace driveid::diagnose
