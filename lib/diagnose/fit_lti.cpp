// SPDX-License-Identifier: Apache-2.0
#include "diagnose/fit_lti.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

namespace driveid::diagnose {
namespace {

// Derivatives 0..order of (1 - u^2)^p on -half..half, p = order + 2, by repeated exact differentiation of its coefficients.
std::vector<std::vector<double>> kernels(int half, double dt, int order) {
  std::vector<double> c{1.0};
  for (int p = 0; p < order + 2; p++) {
    std::vector<double> next(c.size() + 2, 0.0);
    for (std::size_t k = 0; k < c.size(); k++) next[k] += c[k], next[k + 2] -= c[k];
    c = next;
  }
  std::vector<std::vector<double>> out;
  const double length = double(half) * dt;
  double scale = 1.0 / double(half);
  for (int d = 0; d <= order; d++) {
    std::vector<double> w;
    for (int j = -half; j <= half; j++) {
      double value = 0;
      for (std::size_t k = c.size(); k-- > 0;) value = value * (double(j) / half) + c[k];
      w.push_back(scale * value);
    }
    out.push_back(w);
    std::vector<double> derived;
    for (std::size_t k = 1; k < c.size(); k++) derived.push_back(-double(k) * c[k]);   // integration by parts turns the sign
    c = derived;
    scale /= length;
  }
  return out;
}

void add_rows(const std::vector<double> &u, const std::vector<double> &y, const std::vector<std::vector<double>> &w, int n, int m, Eigen::MatrixXd &A, Eigen::VectorXd &b) {
  const int half = int(w[0].size()) / 2, step = std::max(1, half / 4), P = n + m + 1;
  for (int centre = half; centre + half < int(y.size()); centre += step) {
    Eigen::VectorXd row = Eigen::VectorXd::Zero(P);
    double target = 0;
    for (int j = -half; j <= half; j++) {
      const std::size_t at = std::size_t(centre + j), k = std::size_t(j + half);
      for (int d = 0; d < n; d++) row[d] -= w[std::size_t(d)][k] * y[at];
      for (int d = 0; d <= m; d++) row[n + d] += w[std::size_t(d)][k] * u[at];
      target += w[std::size_t(n)][k] * y[at];
    }
    A += row * row.transpose();
    b += row * target;
  }
}

}  // namespace

bool start_lti(driveid_model &model, const std::vector<Prepared> &training, std::string &bad) {
  int n = 0, m = -1;
  for (uint32_t k = 0; k < model.params; k++) (model.param[k].name[0] == 'a' ? n : m) += 1;
  double best = INFINITY;
  Eigen::VectorXd chosen;
  for (const Prepared &r : training)
    if (!r.has("u") || !r.has("y")) {
      bad = r.name + ": lti needs the columns u and y";
      return false;
    }
  for (double width : {8.0, 16.0, 32.0, 64.0, 128.0}) {   // the width whose solution leaves least, relative to its target
    const double dt = training[0].dt_s;
    const auto w = kernels(int(width), dt, n);
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n + m + 1, n + m + 1);
    Eigen::VectorXd b = Eigen::VectorXd::Zero(n + m + 1);
    for (const Prepared &r : training)
      for (const Piece &p : r.pieces) add_rows(p.signal.at("u"), p.signal.at("y"), w, n, m, A, b);
    const Eigen::VectorXd size = A.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    Eigen::MatrixXd unit = size.asDiagonal() * A * size.asDiagonal();
    unit.diagonal().array() += 1e-11;
    const Eigen::VectorXd p = size.asDiagonal() * unit.ldlt().solve(size.asDiagonal() * b);
    const Eigen::VectorXd spread = (size.asDiagonal() * unit.ldlt().solve(Eigen::MatrixXd::Identity(n + m + 1, n + m + 1)) * size.asDiagonal()).diagonal();
    const double quality = (spread.array().abs().sqrt() / (p.array().abs() + 1e-300)).log().mean();
    if (p.allFinite() && quality < best) best = quality, chosen = p;
  }
  if (!chosen.size()) {
    bad = "the record is too short for an lti model: record at least some time constants";
    return false;
  }
  for (uint32_t k = 0; k < model.params; k++) {
    driveid_param &p = model.param[k];
    if (p.state == DRIVEID_PARAM_GIVEN) continue;
    p.state = DRIVEID_PARAM_FREE;
    p.value = p.lo = p.hi = chosen[Eigen::Index(k)];
  }
  return true;
}

}  // namespace driveid::diagnose
