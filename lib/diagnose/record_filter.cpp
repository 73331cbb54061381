// SPDX-License-Identifier: Apache-2.0
// A speed that a drive differences from its counts and filters.
#include <algorithm>
#include <cmath>

#include "diagnose/record.hpp"

namespace driveid::diagnose {
namespace {

constexpr int kBins = 2000;
constexpr double kReturns = 0.03;   // share of slow samples with the one ratio; noise of a tachometer puts a hundredth of that into one bin

}  // namespace

// Wherever no count comes, such a speed decays by the filter's own ratio from sample to sample: a ratio that returns exactly tells the filter.
double filter_ratio(const Prepared &record, const std::string &speed) {
  double top = 0;
  for (const Piece &p : record.pieces)
    for (double w : p.signal.at(speed)) top = std::max(top, std::fabs(w));
  std::vector<int> seen(kBins, 0);
  std::vector<double> sum(kBins, 0.0);
  int pairs = 0;
  for (const Piece &p : record.pieces) {
    const std::vector<double> &w = p.signal.at(speed);
    for (std::size_t k = 0; k + 1 < w.size(); ++k) {
      if (p.filled[k] || p.filled[k + 1] || !(std::fabs(w[k]) > 1e-6 * top) || !(std::fabs(w[k]) < 0.1 * top)) continue;
      ++pairs;
      const double ratio = w[k + 1] / w[k];
      if (!(ratio > 0.05 && ratio < 0.98)) continue;
      ++seen[std::size_t(ratio * kBins)];
      sum[std::size_t(ratio * kBins)] += ratio;
    }
  }
  const auto most = std::max_element(seen.begin(), seen.end()) - seen.begin();
  if (pairs < 200 || seen[std::size_t(most)] < kReturns * pairs) return 0;
  return sum[std::size_t(most)] / seen[std::size_t(most)];
}

void undo_filter(Prepared &record, const std::string &speed, double ratio) {
  for (Piece &p : record.pieces) {
    std::vector<double> &w = p.signal.at(speed);
    for (std::size_t k = w.size(); k-- > 1;) w[k] = (w[k] - ratio * w[k - 1]) / (1 - ratio);
  }
}

}  // namespace driveid::diagnose
