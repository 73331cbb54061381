// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "diagnose/record_column.hpp"

namespace driveid::diagnose {
namespace {

constexpr double kSharedStamps = 0.05;   // of the rows: more are no slip of the logger
constexpr double kGap = 2.5;             // steps

bool same_values(const driveid_record &r, std::size_t a, std::size_t b) {
  for (std::size_t c = 0; c < r.columns; ++c)
    if (r.column[c].value[a] != r.column[c].value[b] && !(std::isnan(r.column[c].value[a]) && std::isnan(r.column[c].value[b]))) return false;
  return true;
}

}  // namespace

std::vector<std::int64_t> spread_stamps(const driveid_record &r, std::vector<Notice> &notices) {
  std::size_t shared = 0;
  std::vector<double> steps;
  for (std::size_t k = 1; k < r.rows; ++k) {
    if (r.t_ns[k] == r.t_ns[k - 1]) shared += !same_values(r, k, k - 1);
    else if (r.t_ns[k] > r.t_ns[k - 1]) steps.push_back(double(r.t_ns[k] - r.t_ns[k - 1]));
  }
  if (steps.size() < 20 || shared < kSharedStamps * double(r.rows)) return {};
  const double step = median_of(steps), dt = step * double(steps.size()) / double(r.rows - 1);
  std::vector<std::int64_t> t(r.t_ns, r.t_ns + r.rows);
  for (std::size_t a = 0, b; a < r.rows; a = b) {
    for (b = a + 1; b < r.rows && r.t_ns[b] >= r.t_ns[b - 1] && double(r.t_ns[b] - r.t_ns[b - 1]) < kGap * step;) ++b;
    const double spacing = b - a > 200 ? double(r.t_ns[b - 1] - r.t_ns[a]) / double(b - 1 - a) : dt;
    for (std::size_t k = a; k < b; ++k) t[k] = r.t_ns[a] + std::int64_t(std::llround(spacing * double(k - a)));
  }
  notices.push_back({"stamps", text("%.0f rows have the stamp of the row before them and other values: the time column has too few digits; rows are taken as %.4g ms apart", double(shared), 1e-6 * dt), ""});
  return t;
}

}  // namespace driveid::diagnose
