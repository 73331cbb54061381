// SPDX-License-Identifier: Apache-2.0
#include "batch/noise.hpp"

#include <cmath>

#include <Eigen/Dense>

namespace driveid::batch {

void NoiseFilter::apply(double *x, std::size_t n) const {
  for (int d = 0; d < order; d++) {
    double in = 0, out = 0;
    for (std::size_t k = 0; k < n; k++) {
      const double now = x[k];
      out = memory * out + now - in;
      in = now;
      x[k] = out;
    }
  }
  const std::size_t p = ar.size();
  for (std::size_t k = n; p && k-- > 0;)
    for (std::size_t j = 1; j <= p && j <= k; j++) x[k] -= ar[j - 1] * x[k - j];
}

NoiseFilter fit_memory(int order, const std::function<double(const NoiseFilter &)> &power) {
  NoiseFilter best, trial;
  best.order = order;
  trial.order = order;
  double least = INFINITY;
  for (double forgets : {0.0, 1e-4, 3e-4, 1e-3, 2e-3, 4e-3, 8e-3, 0.015, 0.03, 0.06, 0.1, 0.16, 0.25, 0.4, 0.6, 0.8, 1.0}) {
    trial.memory = 1 - forgets;
    const double p = power(trial);
    if (p < least * (1 - 1e-6)) least = p, best = trial;
  }
  return best;
}

std::vector<double> fit_short_memory(const std::vector<std::vector<double>> &pieces, int order) {
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(order, order);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(order);
  double rows = 0;
  for (const auto &x : pieces)
    for (std::size_t k = std::size_t(order); k < x.size(); k++, rows += 1)
      for (int i = 0; i < order; i++) {
        right[i] += x[k] * x[k - 1 - std::size_t(i)];
        for (int j = 0; j <= i; j++) gram(i, j) += x[k - 1 - std::size_t(i)] * x[k - 1 - std::size_t(j)];
      }
  gram = gram.selfadjointView<Eigen::Lower>();
  if (!(rows > 40.0 * order) || !(gram.diagonal().minCoeff() > 0)) return {};
  gram.diagonal() *= 1.001;
  const Eigen::VectorXd a = gram.ldlt().solve(right);
  return a.allFinite() ? std::vector<double>(a.data(), a.data() + order) : std::vector<double>();
}

}  // namespace driveid::batch
