// SPDX-License-Identifier: Apache-2.0
// Short rests inside a motion: dry friction holds the axis and is as large as the drive makes it, until it breaks away.
#include <algorithm>
#include <cmath>

#include "diagnose/equation_build.hpp"

namespace driveid::diagnose {
namespace {

constexpr double kSure = 10;      // standard deviations of a dry friction that may hold an axis
constexpr double kNear = 0.3;     // of it, within which the load is the same everywhere
constexpr double kBeyond = 1.15;  // of it, where the drive's noise goes beyond what holds

struct Friction {
  double level = 0, deviation = INFINITY, load = 0;
};

// Dry friction from the rows whose kernel touches no rest.
Friction friction_in_motion(const Equation &e) {
  std::vector<Eigen::Index> moving;
  for (const Track &t : e.tracks)
    for (std::size_t r = 0; r < t.row.size(); ++r) {
      const auto c = t.still.begin() + t.row[r];
      if (std::none_of(c - t.kernel.half, c + t.kernel.half + 1, [](double s) { return s > 0; })) moving.push_back(Eigen::Index(t.first + r));
    }
  Eigen::MatrixXd all(Eigen::Index(e.rows), e.base.cols() + 2);
  all.leftCols(e.base.cols()) = e.base;
  all.col(e.base.cols()) = stack(e, [](const Track &t, std::vector<double> &f) { f.resize(t.state.size()); for (std::size_t k = 0; k < f.size(); ++k) f[k] = t.state[k].direction; }, 0);
  all.col(e.base.cols() + 1).setOnes();
  const Eigen::Index rows = Eigen::Index(moving.size());
  if (rows < 60) return {};
  Eigen::MatrixXd x(rows, all.cols());
  Eigen::VectorXd y(rows);
  for (Eigen::Index k = 0; k < rows; ++k) x.row(k) = all.row(moving[std::size_t(k)]), y[k] = e.y[moving[std::size_t(k)]];
  const Eigen::VectorXd scale = (x.colwise().norm().array() + 1e-300).matrix().transpose().cwiseInverse();
  x = x * scale.asDiagonal();
  Eigen::MatrixXd g = x.transpose() * x;
  g.diagonal().array() += 1e-10;
  const Eigen::LDLT<Eigen::MatrixXd> factor(g);
  const Eigen::VectorXd p = factor.solve(x.transpose() * y), unit = Eigen::VectorXd::Unit(all.cols(), e.base.cols());
  const double spread = (y - x * p).squaredNorm() / double(rows), overlap = 6;   // neighbouring rows see the same samples
  return {p[e.base.cols()] * scale[e.base.cols()], std::sqrt(overlap * spread * factor.solve(unit)[e.base.cols()]) * scale[e.base.cols()], p[e.base.cols() + 1] * scale[e.base.cols() + 1]};
}

}  // namespace

void hold_by_friction(Equation &e) {
  const Friction f = friction_in_motion(e);
  if (!(f.level > kSure * f.deviation)) return;
  for (Track &t : e.tracks)
    for (std::size_t a = 0, n = t.still.size(); a < n; ++a) {
      if (!(t.still[a] > 0)) continue;
      std::size_t b = a;
      while (b + 1 < n && t.still[b + 1] > 0) ++b;
      const std::size_t after = std::min(n - 1, b + std::size_t(t.kernel.half) / 2);
      const double side = t.state[after].direction > 0 ? 1 : -1;   // of the motion that follows: there the drive is as large as friction
      double breakaway = 0, count = 0;
      for (std::size_t k = b > a + 2 ? b - 2 : a; k <= b; ++k) breakaway += t.state[k].torque, count += 1;
      breakaway = breakaway / count - side * f.level;
      // The load that friction stands against: that of the whole record, or where another one is felt here, what the breakaway leaves.
      const double load = std::fabs(breakaway - f.load) < kNear * f.level ? f.load : breakaway;
      const double before = a > std::size_t(t.kernel.half) / 2 ? (t.state[a - std::size_t(t.kernel.half) / 2].direction > 0 ? 1 : -1) : 0;
      for (std::size_t k = a; k <= b; ++k) t.state[k].direction = (1 - t.still[k]) * before + t.still[k] * std::clamp((t.state[k].torque - load) / f.level, -kBeyond, kBeyond);
      a = b;
    }
}

}  // namespace driveid::diagnose
