// SPDX-License-Identifier: Apache-2.0
// The solution of a set of members: values, what is left, covariance.
#include "diagnose/explain_search.hpp"

#include <algorithm>
#include <cmath>

namespace driveid::diagnose {

void put_beside(Eigen::MatrixXd &a, const Eigen::MatrixXd &b) {
  if (b.cols() == 0) return;
  a.conservativeResize(b.rows(), a.cols() + b.cols());
  a.rightCols(b.cols()) = b;
}

double Search::inertia(const Solution &s) const {
  if (full_.base_column.empty()) return 0;
  if (full_.base_column[0].given) return full_.base_column[0].value;
  return s.coefficient.size() ? s.coefficient[0] : 0;
}

Solution Search::solve(const std::vector<Member> &members) const {
  Solution s;
  s.member = members;
  Eigen::MatrixXd x = full_.base;
  Eigen::VectorXd y = full_.y;
  std::vector<Eigen::Index> width;
  for (const Member &m : members) {
    Term t = realise(full_, candidates_[std::size_t(m.candidate)], m.shape, nominal_);
    width.push_back(t.column.cols());
    put_beside(x, t.column);
    if (t.taken.size()) y -= t.taken;
  }
  Eigen::MatrixXd wx = whiten(full_, x);
  Eigen::VectorXd wy = whiten(full_, y);
  BlockGram gram(full_, wx, wy);
  std::vector<int> all;
  for (int k = 0; k < int(x.cols()); ++k) all.push_back(k);
  s.score = gram.cross_validate(all, {});
  s.coefficient = gram.solve(all, {}, false);
  Eigen::Index at = full_.base.cols();
  for (Eigen::Index w : width) s.linear.push_back(s.coefficient.segment(at, w)), at += w;
  s.residual = y - x * s.coefficient;
  s.white = wy - wx * s.coefficient;
  return s;
}

Eigen::MatrixXd Search::covariance(const Solution &s) const {
  Eigen::MatrixXd j = whiten(full_, full_.base);
  std::vector<Eigen::MatrixXd> shapes;
  for (std::size_t m = 0; m < s.member.size(); ++m) {
    const Candidate &c = candidates_[std::size_t(s.member[m].candidate)];
    auto value = [&](const std::vector<double> &shape) {
      Term t = realise(full_, c, shape, nominal_);
      Eigen::VectorXd v = Eigen::VectorXd::Zero(Eigen::Index(full_.rows));
      if (t.column.cols()) v += t.column * s.linear[m];
      if (t.taken.size()) v += t.taken;
      return v;
    };
    Term t = realise(full_, c, s.member[m].shape, nominal_);
    put_beside(j, whiten(full_, t.column));
    Eigen::MatrixXd d(Eigen::Index(full_.rows), Eigen::Index(c.axis.size()));
    for (std::size_t a = 0; a < c.axis.size(); ++a) {
      std::vector<double> up = s.member[m].shape, down = up;
      double step = 0.02 * std::max(std::fabs(up[a]), 1e-3 * (c.axis[a].hi - c.axis[a].lo));
      if (c.axis[a].whole) step = 0.02;
      up[a] += step;
      down[a] -= step;
      d.col(Eigen::Index(a)) = whiten(full_, Eigen::VectorXd((value(up) - value(down)) / (2 * step)));
      if (c.axis[a].whole) d.col(Eigen::Index(a)).setZero();
    }
    shapes.push_back(d);
  }
  for (const auto &d : shapes) put_beside(j, d);
  const Eigen::Index n = j.cols();
  Eigen::VectorXd scale = (j.colwise().norm().array() + 1e-300).matrix().transpose().cwiseInverse();
  for (Eigen::Index k = 0; k < n; ++k)
    if (!(scale[k] < 1e200)) scale[k] = 0;
  Eigen::MatrixXd q = j * scale.asDiagonal(), g = q.transpose() * q;
  g.diagonal().array() += 1e-9;
  Eigen::MatrixXd inverse = g.ldlt().solve(Eigen::MatrixXd::Identity(n, n));
  // sandwich over stretches long against what whitening left of the correlation
  const std::size_t stretch = 60;
  Eigen::MatrixXd meat = Eigen::MatrixXd::Zero(n, n);
  double groups = 0;
  for (std::size_t a = 0; a < full_.rows; a += stretch) {
    std::size_t m = std::min(stretch, full_.rows - a);
    Eigen::VectorXd u = q.middleRows(Eigen::Index(a), Eigen::Index(m)).transpose() * s.white.segment(Eigen::Index(a), Eigen::Index(m));
    meat += u * u.transpose();
    groups += 1;
  }
  double sigma2 = s.white.squaredNorm() / std::max(1.0, rows_ - double(n));
  Eigen::MatrixXd sandwich = inverse * meat * inverse * (groups / std::max(1.0, groups - double(n)));
  Eigen::MatrixXd plain = inverse * sigma2;
  // the sandwich where it has groups to speak of, never below four fifths of the plain one
  Eigen::MatrixXd c = groups > 5 * double(n) ? sandwich : plain;
  for (Eigen::Index k = 0; k < n; ++k)
    if (c(k, k) < 0.64 * plain(k, k) && c(k, k) > 0) {
      double f = std::sqrt(0.64 * plain(k, k) / c(k, k));
      c.row(k) *= f;
      c.col(k) *= f;
    }
  return scale.asDiagonal() * c * scale.asDiagonal();
}

bool Search::sound(const std::vector<Member> &members) const {
  const Solution s = solve(members);
  for (std::size_t m = 0; m < members.size(); ++m) {
    const Candidate &c = candidates_[std::size_t(members[m].candidate)];
    const Term t = realise(full_, c, members[m].shape, nominal_);
    if (!members[m].kept && !lawful(full_, c, members[m].shape, t.drive_part.size() ? Eigen::VectorXd(s.linear[m] / drive_factor(t, s.linear[m])) : s.linear[m], inertia(s))) return false;
  }
  return true;
}

}  // namespace driveid::diagnose
