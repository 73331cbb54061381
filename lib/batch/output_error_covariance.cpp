// SPDX-License-Identifier: Apache-2.0
// What is known of the parameters once the iteration ends.
#include "batch/output_error_inside.hpp"

#include <algorithm>
#include <cmath>

namespace driveid::batch {
namespace {

constexpr double kPartOfScale = 0.3;            // of FreeParam::scale, least step of the agreement
constexpr std::size_t kLags = 4;
constexpr std::size_t kClusters = 40;           // so many windows are blocks enough

// Sums of the projected score over blocks: whole windows where there are many, else parts of about 1/40 of the data each.
std::vector<Eigen::VectorXd> scores(const Fitting &f, const Linear &lin) {
  const Eigen::Index P = lin.A.rows();
  std::vector<Eigen::VectorXd> score;
  const std::size_t m = f.problem.outputs.size(), block = f.windows.size() >= kClusters ? f.rows : std::max<std::size_t>(20, f.rows / 40);
  std::size_t filled = 0;
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(P);
  auto close = [&] {
    if (filled) score.push_back(sum);
    sum.setZero();
    filled = 0;
  };
  for (std::size_t w = 0; w < lin.local.size(); w++) {
    const Local &l = lin.local[w];
    const std::size_t n = f.windows[w].to - f.windows[w].from;
    for (std::size_t from = 0; from < n;) {
      const std::size_t take = std::min(n - from, block - filled);
      for (std::size_t o = 0; o < m; o++)
        sum += l.weight * l.Jp.middleRows(Eigen::Index(o * n + from), Eigen::Index(take)).transpose() * l.r.segment(Eigen::Index(o * n + from), Eigen::Index(take));
      from += take;
      filled += take;
      if (filled == block) close();
    }
    if (f.windows.size() >= kClusters) close();
  }
  close();
  return score;
}

}  // namespace

Eigen::MatrixXd pseudo_inverse(const Eigen::MatrixXd &A) {
  const Eigen::VectorXd size = A.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  Eigen::MatrixXd unit = size.asDiagonal() * A * size.asDiagonal();
  unit.diagonal().array() += 1e-12;
  return size.asDiagonal() * unit.ldlt().solve(Eigen::MatrixXd::Identity(A.rows(), A.cols())) * size.asDiagonal();
}

// How alike a step up and a step down are, by parameter: 1 where the differences are derivatives; towards 0 where the simulation sticks and slips at the
// bidding of a noisy input, so that a step only moves it to another chance, and the information in the differences is as imaginary. Steps are at
// least a part of what was not known at the start: between two chances everything is smooth.
Eigen::VectorXd agreement(const Fitting &fitted, const Point &point, const Stack &base, const Linear &lin) {
  const Eigen::Index P = lin.A.rows();
  Fitting f = fitted;
  for (std::size_t k = 0; k < f.free.size(); k++) f.step[k] = std::max(f.step[k], kPartOfScale * f.free[k].scale);
  std::vector<Stack> up = lin.columns, down = lin.columns;
  if (!columns(f, point, base, up) || !columns(f, point, base, down, true)) return Eigen::VectorXd::Zero(P);
  Eigen::VectorXd both = Eigen::VectorXd::Zero(P), ups = both, downs = both, alike = Eigen::VectorXd::Ones(P);
  for (std::size_t w = 0; w < f.windows.size(); w++) {
    const Local u = localise(f, w, base, up), d = localise(f, w, base, down);
    const double weight = lin.local[w].weight;
    both += weight * u.Jp.cwiseProduct(d.Jp).colwise().sum().transpose();
    ups += weight * u.Jp.colwise().squaredNorm().transpose();
    downs += weight * d.Jp.colwise().squaredNorm().transpose();
  }
  for (Eigen::Index k = 0; k < P; k++)
    if (ups[k] > 0 && downs[k] > 0) alike[k] = std::clamp(both[k] / std::sqrt(ups[k] * downs[k]), 0.0, 1.0);
  return alike;
}

// Sandwich of block scores, products with neighbours under Bartlett's weights; never below what white residuals of this size would give.
void covariance(const Fitting &f, const Linear &lin, const Eigen::VectorXd &alike, OutputErrorResult &result) {
  const Eigen::Index P = lin.A.rows();
  const std::vector<Eigen::VectorXd> score = scores(f, lin);
  const std::size_t m = f.problem.outputs.size();
  Eigen::MatrixXd meat = Eigen::MatrixXd::Zero(P, P);
  for (std::size_t k = 0; k < score.size(); k++) {
    meat += score[k] * score[k].transpose();
    for (std::size_t lag = 1; lag <= kLags && lag <= k; lag++)
      meat += (1.0 - double(lag) / double(kLags + 1)) * (score[k] * score[k - lag].transpose() + score[k - lag] * score[k].transpose());
  }
  for (std::size_t k = 0; k < f.free.size(); k++) meat(Eigen::Index(k), Eigen::Index(k)) += std::pow(lin.prior[Eigen::Index(k)] * f.free[k].prior, 2);
  double squares = 0;
  for (const Local &l : lin.local) squares += l.weight * l.r.squaredNorm();
  // parameters, and initial states inside windows that several blocks share, have taken part of the scores
  const double blocks = double(score.size()), states = f.windows.size() >= kClusters ? 0 : double(f.states.size() * f.windows.size());
  meat *= blocks / std::max(0.25 * blocks, blocks - double(P) - states);
  const Eigen::MatrixXd bread = pseudo_inverse(lin.A);
  Eigen::MatrixXd cov = bread * meat * bread;
  const double freedom = double(f.rows * m) - double(P) - double(f.states.size() * f.windows.size());
  const Eigen::MatrixXd white = squares / std::max(1.0, freedom) * bread;
  for (Eigen::Index k = 0; k < P; k++)
    if (cov(k, k) < white(k, k)) {
      const double grow = std::sqrt(white(k, k) / std::max(cov(k, k), 1e-300));
      cov.row(k) *= grow;
      cov.col(k) *= grow;
    }
  const Eigen::VectorXd grow = alike.cwiseMax(1e-6).cwiseSqrt().cwiseInverse();   // information that is not there
  cov = grow.asDiagonal() * cov * grow.asDiagonal();
  result.covariance = cov;
  // 97.5 % point of an estimate divided by a deviation from few neighbouring blocks (Kiefer and Vogelsang 2005, Bartlett's weights)
  const double b = std::min(0.5, double(kLags + 1) / std::max(1.0, blocks));
  result.quantile = 1.96 + 2.9694 * b + 0.4160 * b * b - 0.5324 * b * b * b;
}

}  // namespace driveid::batch
