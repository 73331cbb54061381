// SPDX-License-Identifier: Apache-2.0
// How sure each row is: what a drive read at instants, or an idealised friction, gets wrong is not the same everywhere.
#include <algorithm>
#include <cmath>
#include <iterator>

#include "diagnose/explain_core.hpp"

namespace driveid::diagnose {
namespace {

constexpr double kClip = 9;           // medians beyond which one row says no more of its kind
constexpr double kNoisier = 1.25;     // than the calmest rows: less is chance
constexpr double kLeastWeight = 0.1;
constexpr double kMatters = 0.6;      // a weight that is worth a second look,
constexpr double kMany = 0.01;        // in this share of the rows

// How much the drive jumps inside each row's kernel, and whether the motion turns round or rests there.
struct Kinds {
  std::vector<double> slew;
  std::vector<unsigned char> turns;
};

Kinds kinds_of(const Equation &e) {
  Kinds k{std::vector<double>(e.rows, 0.0), std::vector<unsigned char>(e.rows, 0)};
  const int p = int(e.ar.size());
  for (const Track &t : e.tracks) {
    std::vector<double> jump(t.state.size() + 1, 0.0), turn(t.state.size() + 1, 0.0);
    for (std::size_t j = 1; j < t.state.size(); ++j) {
      const double d = t.state[j].drive - t.state[j - 1].drive;
      jump[j + 1] = jump[j] + d * d;
      turn[j + 1] = turn[j] + (!e.electrical && t.state[j].direction != t.state[j - 1].direction);
    }
    for (std::size_t r = 0; r < t.row.size(); ++r) {
      const int reach = t.kernel.half + (r ? p * (t.row[r] - t.row[r - 1]) : 0);   // a whitened row looks back
      const auto a = std::size_t(std::max(1, t.row[r] - reach)), b = std::size_t(t.row[r] + t.kernel.half);
      k.slew[t.first + r] = jump[b] - jump[a];
      k.turns[t.first + r] = turn[b] > turn[a];
    }
  }
  return k;
}

// Noise is not the same everywhere: a drive read at instants is least certain where it jumps, dry friction where the motion turns round.
// Rows of a kind that even the flexible model misses by more count for less.
std::vector<double> weights_by_kind(const Equation &e, const Eigen::VectorXd &residual) {
  static const double share[] = {0.5, 0.25, 0.15, 0.06, 0.03, 0.01};   // of the rows of a kind, from the calmest drive to the wildest
  const Eigen::VectorXd white = whiten(e, residual);
  const Kinds kinds = kinds_of(e);
  std::vector<double> weight = e.weight;
  double calm = 0;
  for (int turning = 0; turning < (e.electrical ? 1 : 2); ++turning) {
    std::vector<std::size_t> row;
    for (std::size_t k = 0; k < e.rows; ++k)
      if (e.weight[k] > 0 && kinds.turns[k] == turning) row.push_back(k);
    std::sort(row.begin(), row.end(), [&](std::size_t a, std::size_t b) { return kinds.slew[a] < kinds.slew[b]; });
    double to_share = 0, last = 0;
    for (std::size_t bin = 0, from = 0; bin < std::size(share) && from < row.size(); ++bin) {
      to_share += share[bin];
      const std::size_t to = bin + 1 == std::size(share) ? row.size() : std::size_t(to_share * double(row.size()));
      if (to - from < 30 && to < row.size()) continue;
      std::vector<double> size;
      for (std::size_t k = from; k < to; ++k) size.push_back(std::fabs(white[Eigen::Index(row[k])]));
      auto mid = size.begin() + std::ptrdiff_t(size.size() / 2);
      std::nth_element(size.begin(), mid, size.end());
      const double limit = kClip * *mid;
      double sum = 0;
      for (double s : size) sum += std::min(s, limit) * std::min(s, limit);
      const double deviation = size.size() < 30 && last > 0 ? last : std::sqrt(sum / double(size.size()));
      if (calm == 0) calm = deviation;
      if (deviation > kNoisier * calm)
        for (std::size_t k = from; k < to; ++k) weight[row[k]] = std::max(kLeastWeight, calm / deviation);
      last = deviation;
      from = to;
    }
  }
  return weight;
}


bool matters(const Equation &e, const std::vector<double> &weight) {
  const auto light = std::count_if(weight.begin(), weight.end(), [](double w) { return w > 0 && w < kMatters; });
  return double(light) > kMany * double(e.rows);
}

}  // namespace

bool weigh_by_kind(Search &search, const Eigen::VectorXd &residual) {
  std::vector<double> weight = weights_by_kind(search.equation(), residual);
  if (!matters(search.equation(), weight)) return false;
  search.weigh(std::move(weight));
  return true;
}

}  // namespace driveid::diagnose
