// SPDX-License-Identifier: Apache-2.0
#include "diagnose/confidence.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace driveid::diagnose {
namespace {

struct Knot {
  double at, right;
};

double between(const Knot *k, std::size_t count, double x) {
  if (x <= k[0].at) return k[0].right;
  for (std::size_t j = 1; j < count; ++j)
    if (x <= k[j].at) return k[j - 1].right + (x - k[j - 1].at) / (k[j].at - k[j - 1].at) * (k[j].right - k[j - 1].right);
  return k[count - 1].right;
}

// Frequencies of 91 first answers, in classes of the evidence (docs/hidden-effects.md).
constexpr Knot kEvidence[] = {{0.35, 0.35}, {0.7, 0.6}, {0.98, 0.77}};
constexpr Knot kRest[] = {{0.96, 0.0}, {0.99, 1.0}};
constexpr double kMost = 0.96;

}  // namespace

double confidence(double lead, double gain, double explained) {
  const double ahead = 1 - std::exp(-std::max(0.0, lead) / 6), strong = 1 - std::exp(-std::max(0.0, gain) / 8), whole = std::clamp(explained / 0.7, 0.2, 1.0);
  const double evidence = (0.35 + 0.63 * ahead) * strong * whole, held = between(kEvidence, std::size(kEvidence), evidence);
  const double complete = between(kRest, std::size(kRest), explained) * std::clamp((evidence - 0.7) / 0.27, 0.0, 1.0);
  return held + complete * (kMost - held);
}

}  // namespace driveid::diagnose
