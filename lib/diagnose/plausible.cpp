// SPDX-License-Identifier: Apache-2.0
#include "diagnose/plausible.hpp"

#include <cmath>
#include <cstdio>

#include "diagnose/compare_core.hpp"

namespace driveid::diagnose {
namespace {

constexpr double kFollows = 0.7;    // correlation above which a factor means something
constexpr double kFactor = 3;       // no drive changes that much between two records
constexpr double kNear = 0.15;      // of a known ratio of units

bool has_values(const driveid_model &model, const Equation &e) {
  for (const BaseColumn &b : e.base_column) {
    const driveid_param *p = b.name.empty() || b.given ? nullptr : driveid_model_param(&model, b.name.c_str());
    if (p && p->state == DRIVEID_PARAM_UNSET) return false;
  }
  for (uint32_t k = 0; k < model.effects; k++)
    for (uint32_t i = 0; i < model.effect[k].params; i++)
      if (model.effect[k].param[i].state == DRIVEID_PARAM_UNSET) return false;
  return !e.base_column.empty();
}

std::string unit_guess(double factor) {
  static const struct { double ratio; const char *what; } known[] = {{1000, "the input in thousandths (mA, mN m)"}, {1e-3, "the input in thousands"},
      {1 / 57.29578, "the angle or speed in degrees"}, {6.283185, "the angle in turns"}, {1 / 9.549297, "the speed in rpm"}, {1e3 / 6.283185, "the angle in thousandths of a turn"}};
  for (const auto &k : known)
    if (std::fabs(factor / k.ratio - 1) < kNear) return std::string(": it looks like ") + k.what;
  return "";
}

}  // namespace

std::vector<Notice> implausible(const EquationSet &set, const driveid_model &model, const std::string &record) {
  std::vector<Notice> out;
  for (const Equation &e : set.equation) {
    if (!has_values(model, e)) continue;
    const Eigen::VectorXd expected = e.drive - equation_residual(e, model);
    const double product = e.drive.dot(expected), own = expected.squaredNorm(), measured = e.drive.squaredNorm();
    if (!(own > 0) || !(measured > 0)) continue;
    const double correlation = product / std::sqrt(own * measured), factor = std::sqrt(measured / own);
    if (!(std::fabs(correlation) > kFollows)) continue;
    char text[240];
    if (correlation < 0) {
      std::snprintf(text, sizeof text, "the %s equation holds with the opposite sign: a column's sign is swapped; map it with a minus (--map i_A=-COLUMN)", e.signal.c_str());
      out.push_back({"sign", text, record});
    }
    if (factor > kFactor || factor < 1 / kFactor) {
      const std::string guess = unit_guess(factor);
      std::snprintf(text, sizeof text, "the drive is %.4g times what the model's own values make of the motion%s", factor,
                    guess.empty() ? ": they are not this drive's; fit it" : (guess + "; state the unit in --map").c_str());
      out.push_back({guess.empty() ? "values" : "units", text, record});
    }
  }
  return out;
}

namespace {

constexpr double kOpposed = -0.3;

// What could pass for a negative inertia without being one: friction, a load, forces that go with the place.
FineSignal bystander(int which) {
  return [which](const Track &t, std::vector<double> &x) {
    x.resize(t.state.size());
    for (std::size_t k = 0; k < x.size(); k++) {
      const driveid_effect_state &s = t.state[k];
      x[k] = which == 0 ? 1.0 : which == 1 ? s.direction : which == 2 ? s.angle : which == 3 ? std::sin(s.angle) : std::cos(s.angle);
    }
  };
}

// Share of a record's drive that goes with the acceleration alone, with its sign: -1 .. 1.
double share_of_acceleration(const Equation &e, const Eigen::MatrixXd &x, int record) {
  const Eigen::Index n = x.cols();
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(n);
  double square = 0, rows = 0;
  for (const Track &t : e.tracks) {
    if (t.record != record || t.row.empty()) continue;
    const auto part = x.middleRows(Eigen::Index(t.first), Eigen::Index(t.row.size()));
    const auto y = e.y.segment(Eigen::Index(t.first), Eigen::Index(t.row.size()));
    gram += part.transpose() * part;
    right += part.transpose() * y;
    square += y.squaredNorm();
    rows += double(t.row.size());
  }
  if (rows < 100 || !(square > 0)) return 0;
  const Eigen::VectorXd scale = gram.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  gram = scale.asDiagonal() * gram * scale.asDiagonal();
  gram.diagonal().array() += 1e-6;
  const Eigen::MatrixXd inverse = gram.ldlt().solve(Eigen::MatrixXd::Identity(n, n));
  const double coefficient = inverse.row(0).dot(scale.cwiseProduct(right));
  return coefficient / std::sqrt(inverse(0, 0) * square);
}

}  // namespace

std::string opposed(const EquationSet &set, const std::vector<Prepared> &training, const std::vector<Prepared> &held_out) {
  for (const Equation &e : set.equation) {
    if (e.electrical || e.base.cols() < 1 || e.base_column.empty() || e.base_column[0].given) continue;
    Eigen::MatrixXd x(e.base.rows(), e.base.cols() + 5);
    x.leftCols(e.base.cols()) = e.base;
    for (int k = 0; k < 5; k++) x.col(e.base.cols() + k) = stack(e, bystander(k), 0);
    for (std::size_t r = 0; r < training.size() + held_out.size(); r++)
      if (share_of_acceleration(e, x, int(r)) < kOpposed)
        return (r < training.size() ? training[r] : held_out[r - training.size()]).name + ": input and motion have opposite signs (the inertia comes out negative): a column has the wrong sign, map it with a minus (--map i_A=-COLUMN)";
  }
  return "";
}

}  // namespace driveid::diagnose
