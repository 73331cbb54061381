// SPDX-License-Identifier: Apache-2.0
// What decides between explanations: ranks over blocks, breadth, the score over stretches, the mask, the general families.
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "axis.hpp"
#include "diagnose/confidence.hpp"
#include "diagnose/equation.hpp"
#include "diagnose/evidence.hpp"
#include "diagnose/explain_core.hpp"
#include "diagnose/floor.hpp"
#include "diagnose/record.hpp"

using namespace driveid::diagnose;

namespace {

struct Pair {
  Eigen::VectorXd before, after;
};

// White noise in which an effect of the given size speaks in every `every`-th stretch of 60 rows, and what is left without it.
Pair hidden_in(double size, int every, unsigned seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal;
  Pair p{Eigen::VectorXd(6000), Eigen::VectorXd(6000)};
  Eigen::VectorXd x = Eigen::VectorXd::Zero(6000);
  for (Eigen::Index k = 0; k < 6000; ++k) {
    if (k / 60 % every == 0) x[k] = std::sin(0.3 * double(k));
    p.before[k] = normal(rng) + size * x[k];
  }
  p.after = p.before - x.dot(p.before) / x.squaredNorm() * x;
  return p;
}

Equation axis_equation(const Axis &axis, unsigned seed, double rate_Hz = 500) {
  Log log = run_axis(axis, 12, seed, rate_Hz);
  log.seal("record");
  driveid_model m;
  driveid_model_init(&m, DRIVEID_STRUCTURE_RIGID_AXIS);
  driveid_model_give(&m, "K_t_Nm_A", 0.08);
  EquationSet set = make_equations(m, {prepare(log.record, m)}, {});
  EXPECT_EQ(set.equation.size(), 1u) << set.bad;
  return std::move(set.equation.at(0));
}

double removed(Equation &e, const char *family) {
  const std::vector<Family> all = make_families(e);
  find_floor(e, all);
  for (const Family &f : all) {
    if (f.name != family) continue;
    Eigen::MatrixXd x(e.base.rows(), e.base.cols() + f.column.cols());
    x << e.base, f.column;
    BlockGram gram(e, whiten(e, x), whiten(e, e.y));
    std::vector<int> base, with;
    std::vector<double> ridge;
    for (int k = 0; k < int(x.cols()); ++k) {
      if (k < int(e.base.cols())) base.push_back(k);
      with.push_back(k);
      ridge.push_back(k < int(e.base.cols()) ? 0 : 1e-3);
    }
    return 1 - gram.cross_validate(with, ridge).total / gram.cross_validate(base, {}).total;
  }
  ADD_FAILURE() << "no family " << family;
  return 0;
}

}  // namespace

TEST(Evidence, RanksWeighManyPlacesMoreThanOne) {
  std::vector<double> before(40, 1.0), everywhere(40, 0.9), once = before;
  for (std::size_t k = 0; k < 40; ++k) everywhere[k] += 1e-3 * double(k);
  for (std::size_t k = 0; k < 40; ++k) once[k] += 1e-3 * double(k % 7) - 3e-3;
  once[5] = -100;   // one block, however large
  EXPECT_GT(evidence(before, everywhere), 5);
  EXPECT_LT(evidence(before, once), 2);
  for (std::size_t k = 0; k < 40; ++k) once[k] = k < 3 ? 0.5 : 1.01;   // three large gains, a small loss everywhere else
  EXPECT_LT(evidence(before, once), -3);
  EXPECT_EQ(evidence(before, before), 0);
  EXPECT_LT(evidence(everywhere, before), -5);
}

TEST(Evidence, BreadthIsWhatTheBestTenthLeaves) {
  std::vector<double> before(20, 1.0), even(20, 0.5), one(20, 1.0);
  one[3] = 0.5;
  EXPECT_NEAR(broad(before, even), 0.9, 0.001);
  EXPECT_NEAR(broad(before, one), 0.0, 1e-12);
  EXPECT_EQ(broad(even, before), 0);   // nothing was gained
}

// A regressor that is absent from most of the record still speaks clearly where it is there.
TEST(Evidence, WhereAnEffectIsSilentItWeighsNothing) {
  const Pair strong = hidden_in(0.5, 5, 1), none = hidden_in(0, 5, 2);
  EXPECT_GT(consistency(strong.before, strong.after), 3);
  EXPECT_LT(consistency(none.before, none.after), 3);
}

TEST(Evidence, OneStretchBringsNoMoreThanOne) {
  Pair p = hidden_in(0, 1, 3);
  p.after = p.before;
  p.before.segment(600, 20).array() += 1000;   // a glitch that the explanation removes
  EXPECT_NEAR(consistency(p.before, p.after), 1, 1e-9);
  EXPECT_EQ(consistency(p.after, p.after), 0);
}

// Three wrong samples are left out; what is large in a tenth of the record belongs to the drive and stays.
TEST(Evidence, LoneOutliersAreMaskedAndManyAreNot) {
  Equation e = axis_equation({}, 21);
  std::mt19937 rng(4);
  std::normal_distribution<double> normal;
  Eigen::VectorXd residual(Eigen::Index(e.rows));
  for (Eigen::Index k = 0; k < residual.size(); ++k) residual[k] = normal(rng);
  Eigen::VectorXd few = residual, many = residual;
  for (Eigen::Index k : {100, 300, 500}) few[k] = 50;
  for (Eigen::Index k = 0; k < many.size(); k += 10) many[k] = 50;
  mask_outliers(e, few);
  ASSERT_EQ(e.mask.size(), e.rows);
  std::size_t masked = 0;
  for (unsigned char m : e.mask) masked += m;
  EXPECT_EQ(masked, 3u);
  EXPECT_TRUE(e.mask[300]);
  e.mask.clear();
  mask_outliers(e, many);
  EXPECT_TRUE(e.mask.empty());
}

// Each family takes the error that is regular in its coordinates, and no other takes it.
TEST(Families, TakeWhatIsRegularInTheirCoordinates) {
  Axis friction, cogging;
  friction.coulomb = 0.012;
  cogging.cogging = 0.02;
  cogging.order = 2;
  Equation dry = axis_equation(friction, 22), wave = axis_equation(cogging, 23), complete = axis_equation({}, 24);
  EXPECT_GT(removed(dry, "speed"), 0.5);
  EXPECT_LT(removed(dry, "turn"), 0.1);
  EXPECT_GT(removed(wave, "turn"), 0.5);
  EXPECT_LT(removed(wave, "speed"), 0.1);
  for (const char *family : {"speed", "turn", "drive", "inertia_time"}) EXPECT_LT(removed(complete, family), 0.02) << family;
}

// Where dry friction holds the axis between two motions it is as large as the drive, not what a sign says.
TEST(Equation, FrictionAtAShortRestIsWhatTheDriveMakesIt) {
  Axis axis;
  axis.coulomb = 0.03;
  axis.sigma_i = 0.002;
  Equation e = axis_equation(axis, 3, 1000);
  double held = 0;
  for (const Track &t : e.tracks)
    for (double s : t.still) held += s;
  EXPECT_GT(held, 20);
  const auto error = [&](bool signs) {
    Eigen::MatrixXd x(Eigen::Index(e.rows), e.base.cols() + 1);
    x.leftCols(e.base.cols()) = e.base;
    x.col(e.base.cols()) = stack(e, [&](const Track &t, std::vector<double> &f) {
      f.resize(t.state.size());
      for (std::size_t k = 0; k < f.size(); ++k) f[k] = !signs || t.still[k] == 0 ? t.state[k].direction : t.state[k].speed > 0 ? 1 : -1;
    }, 0);
    return std::sqrt((e.y - x * x.colPivHouseholderQr().solve(e.y)).squaredNorm() / double(e.rows));
  };
  std::printf("error %g with what the drive makes of it, %g with signs\n", error(false), error(true));
  EXPECT_LT(error(false), 0.6 * error(true));
}

TEST(Weights, RowsOfAKindThatIsLessSureCountForLess) {
  Axis axis;
  axis.coulomb = 0.012;
  Equation e = axis_equation(axis, 4);
  find_floor(e, make_families(e));
  std::vector<unsigned char> turns(e.rows, 0);
  for (const Track &t : e.tracks)
    for (std::size_t r = 0; r < t.row.size(); ++r)
      for (int k = t.row[r] - t.kernel.half; k < t.row[r] + t.kernel.half; ++k) turns[t.first + r] |= t.state[std::size_t(k)].direction != t.state[std::size_t(k) + 1].direction;
  Search search(e, {}, 1);
  std::mt19937 rng(5);
  std::normal_distribution<double> normal;
  Eigen::VectorXd alike(Eigen::Index(e.rows)), unlike(Eigen::Index(e.rows));
  for (std::size_t k = 0; k < e.rows; ++k) alike[Eigen::Index(k)] = normal(rng), unlike[Eigen::Index(k)] = alike[Eigen::Index(k)] * (turns[k] ? 8 : 1);
  EXPECT_FALSE(weigh_by_kind(search, alike));
  ASSERT_TRUE(weigh_by_kind(search, unlike));
  double there = 0, elsewhere = 0, many = 0, rest = 0;
  for (std::size_t k = 0; k < e.rows; ++k)
    if (search.equation().weight[k] > 0) (turns[k] ? there : elsewhere) += search.equation().weight[k], (turns[k] ? many : rest) += 1;
  EXPECT_LT(there / many, 0.35);
  EXPECT_GT(elsewhere / rest, 0.6);   // a whitened row looks back at those before it
}

TEST(Confidence, GrowsWithEachKindOfEvidenceAndStaysAFrequency) {
  double before = 0;
  for (double x : {0.0, 1.0, 3.0, 10.0, 30.0, 100.0}) {
    EXPECT_GE(confidence(x, 100, 1), before);
    EXPECT_GE(confidence(100, x, 1), confidence(100, 0.5 * x, 1));
    before = confidence(x, 100, 1);
  }
  for (double share : {0.0, 0.3, 0.9, 0.97, 1.0}) EXPECT_LE(confidence(100, 100, share), confidence(100, 100, share + 0.05));
  EXPECT_LT(confidence(100, 100, 0.9), 0.8);   // something is left that the answer does not say
  EXPECT_GT(confidence(100, 100, 1), 0.9);
  EXPECT_LT(confidence(1000, 1000, 1), 0.98);   // nobody is always right
  EXPECT_LT(confidence(0, 20, 1), 0.5);
}
