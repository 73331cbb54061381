// SPDX-License-Identifier: Apache-2.0
#include "diagnose/evidence.hpp"

#include <algorithm>
#include <cmath>

namespace driveid::diagnose {

double evidence(const std::vector<double> &before, const std::vector<double> &after) {
  std::vector<double> change;
  for (std::size_t b = 0; b < before.size(); ++b)
    if (before[b] != after[b]) change.push_back(before[b] - after[b]);
  if (change.size() < 4) return 0;
  std::sort(change.begin(), change.end(), [](double a, double b) { return std::fabs(a) < std::fabs(b); });
  double sum = 0, square = 0;
  for (std::size_t k = 0; k < change.size(); ++k) {
    const double rank = double(k + 1);
    sum += change[k] > 0 ? rank : -rank;
    square += rank * rank;
  }
  return sum / std::sqrt(square);
}

double broad(const std::vector<double> &before, const std::vector<double> &after) {
  std::vector<double> change;
  double whole = 0;
  for (std::size_t b = 0; b < before.size(); ++b) change.push_back(before[b] - after[b]), whole += change.back();
  if (!(whole > 0)) return 0;
  std::sort(change.begin(), change.end());
  const std::size_t out = std::max<std::size_t>(1, (change.size() + 5) / 10);
  double left = 0;
  for (std::size_t b = 0; b + out < change.size(); ++b) left += change[b];
  return left / whole;
}

double consistency(const Eigen::VectorXd &before, const Eigen::VectorXd &after, Eigen::Index stretch) {
  double sum = 0, square = 0;
  for (Eigen::Index a = 0; a < before.size(); a += stretch) {
    const Eigen::Index n = std::min(stretch, before.size() - a);
    const double u = before.segment(a, n).dot(before.segment(a, n) - after.segment(a, n));
    sum += u;
    square += u * u;
  }
  return square > 0 ? sum / std::sqrt(square) : 0;
}

}  // namespace driveid::diagnose
