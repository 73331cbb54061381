// SPDX-License-Identifier: Apache-2.0
// A smaller equation made of stretches of a large one, for searches.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "diagnose/explain_candidate.hpp"

namespace driveid::diagnose {

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
