// SPDX-License-Identifier: Apache-2.0
// Record preparation and the kernels, against first principles.
#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "axis.hpp"
#include "diagnose/equation.hpp"
#include "diagnose/record.hpp"
#include "diagnose/record_column.hpp"

using namespace driveid::diagnose;

namespace {

driveid_model axis_model() {
  driveid_model m;
  driveid_model_init(&m, DRIVEID_STRUCTURE_RIGID_AXIS);
  driveid_model_give(&m, "K_t_Nm_A", 0.08);
  return m;
}

bool noticed(const Prepared &p, const char *kind) {
  for (const Notice &n : p.notices)
    if (n.kind == kind) return true;
  return false;
}

}  // namespace

// The kernels must differentiate a parabola exactly: 1e-9 of the largest term is rounding.
TEST(Kernel, ParabolasPassExactly) {
  for (int half : {4, 7, 20, 80}) {
    const double dt = 1e-3;
    Kernel k = make_kernel(half, dt);
    double value = 0, first = 0, second = 0;
    for (int i = -half; i <= half; ++i) {
      double t = i * dt, x = 3 + 5 * t + 7 * t * t;
      value += k.w[0][std::size_t(i + half)] * (3 + 5 * t);
      first += k.w[1][std::size_t(i + half)] * x;
      second += k.w[2][std::size_t(i + half)] * x;
    }
    EXPECT_NEAR(value, 3, 1e-9);
    EXPECT_NEAR(first, 5, 1e-8);
    EXPECT_NEAR(second, 14, 1e-5);
  }
}

TEST(Record, WrappedAnglesAreUnwrapped) {
  Log log = run_axis({}, 6, 1);
  std::vector<double> plain = log.theta_rad;
  for (double &q : log.theta_rad) q -= 6.283185307179586 * std::floor(q / 6.283185307179586);
  log.seal("wrapped");
  Prepared p = prepare(log.record, axis_model());
  ASSERT_TRUE(p.bad.empty()) << p.bad;
  EXPECT_TRUE(noticed(p, "unwrapped"));
  const auto &x = p.pieces[0].signal.at("theta_rad");
  for (std::size_t k = 0; k < x.size(); ++k) ASSERT_NEAR(x[k] - x[0], plain[k] - plain[0], 1e-6) << k;
}

TEST(Record, GapsSplitAndSpikesAreMended) {
  Log log = run_axis({}, 8, 2);
  log.theta_rad[1000] += 40;
  log.t_ns.erase(log.t_ns.begin() + 2000, log.t_ns.begin() + 2100);
  log.i_A.erase(log.i_A.begin() + 2000, log.i_A.begin() + 2100);
  log.theta_rad.erase(log.theta_rad.begin() + 2000, log.theta_rad.begin() + 2100);
  log.seal("gap");
  Prepared p = prepare(log.record, axis_model());
  EXPECT_EQ(p.pieces.size(), 2u);
  EXPECT_TRUE(noticed(p, "gap"));
  EXPECT_TRUE(noticed(p, "glitch"));
  const auto &x = p.pieces[0].signal.at("theta_rad");
  EXPECT_LT(std::fabs(x[1000] - 0.5 * (x[999] + x[1001])), 0.05);
}

// Two wrong samples close together are no motion either: left in, they would decide the inertia.
TEST(Record, GlitchesCloseTogetherAreMended) {
  Log log = run_axis({}, 8, 2);
  const std::vector<double> right = log.theta_rad;
  log.theta_rad[1200] += 4;
  log.theta_rad[1204] -= 3;
  log.seal("two glitches");
  Prepared p = prepare(log.record, axis_model());
  const auto &x = p.pieces[0].signal.at("theta_rad");
  for (std::size_t k : {1200u, 1204u}) EXPECT_NEAR(x[k] - x[1100], right[k] - right[1100], 0.05);
}

// A voltage that a current loop applies for one sample is real, however lone; a reading beyond all that is ever applied is not.
TEST(Record, PulsesOfAVoltageAreKept) {
  std::mt19937 rng(1);
  std::normal_distribution<double> normal;
  std::vector<double> v(4000);
  for (std::size_t k = 0; k < v.size(); ++k) v[k] = 5 * ((k / 400) % 2 ? 1 : -1) + 0.01 * normal(rng);
  for (std::size_t k = 200; k < v.size(); k += 400) v[k] += v[k] > 0 ? -4 : 4;
  v[1700] = 60;
  const std::vector<double> read = v;
  std::vector<Notice> notices;
  mend_glitches(v, "v_V", notices);
  for (std::size_t k = 200; k < v.size(); k += 400) EXPECT_EQ(v[k], read[k]) << k;
  EXPECT_LT(std::fabs(v[1700]), 6);
  v = read;
  mend_glitches(v, "theta_rad", notices);
  EXPECT_NE(v[200], read[200]);
}

TEST(Record, SpeedInOtherUnitsIsNoticed) {
  Log log = run_axis({}, 6, 3);
  std::vector<double> speed(log.theta_rad.size(), 0.0);
  for (std::size_t k = 1; k + 1 < speed.size(); ++k) speed[k] = -9.549297 * (log.theta_rad[k + 1] - log.theta_rad[k - 1]) / 0.004;
  log.seal("rpm");
  log.columns.push_back({"omega_rad_s", speed.data()});
  log.record.column = log.columns.data();
  log.record.columns = log.columns.size();
  Prepared p = prepare(log.record, axis_model());
  EXPECT_TRUE(noticed(p, "units"));
  EXPECT_TRUE(noticed(p, "sign"));
}

// A wrap says the unit, a step the encoder, stamps seconds apart the clock: none is taken in silence.
TEST(Record, OtherUnitsShowInTheColumnItself) {
  const Log plain = run_axis({}, 6, 1);
  auto with = [&](const std::function<void(Log &)> &change) {
    Log log = plain;
    change(log);
    log.seal("units");
    return prepare(log.record, axis_model());
  };
  const double turn = 6.283185307179586;
  EXPECT_FALSE(noticed(with([](Log &) {}), "units"));
  const Prepared degrees = with([&](Log &l) { for (double &q : l.theta_rad) q = 360 * (q / turn - std::floor(q / turn)); });
  EXPECT_TRUE(noticed(degrees, "units"));
  const auto &x = degrees.pieces[0].signal.at("theta_rad");
  for (std::size_t k = 0; k < x.size(); ++k) ASSERT_NEAR(x[k] - x[0], 360 / turn * (plain.theta_rad[k] - plain.theta_rad[0]), 1e-6) << k;   // unwrapped at 360, not at what was seen
  EXPECT_TRUE(noticed(with([&](Log &l) { for (double &q : l.theta_rad) q = std::round(q / turn * 16384); }), "units"));
  EXPECT_TRUE(noticed(with([](Log &l) { for (auto &t : l.t_ns) t *= 1000; }), "units"));
}

TEST(Record, StepsAreNoticedAndAnAxisAtItsExtremesIsNotClipped) {
  Log log = run_axis({}, 6, 1);
  const double turn = 6.283185307179586;
  for (double &q : log.theta_rad) q = turn / 500 * std::floor(q / turn * 500);
  log.seal("coarse");
  Prepared p = prepare(log.record, axis_model());
  EXPECT_TRUE(noticed(p, "quantised"));
  EXPECT_FALSE(noticed(p, "clipped"));
  const double most = *std::max_element(log.theta_rad.begin(), log.theta_rad.end());
  for (double &q : log.theta_rad) q = std::min(q, 0.5 * most);   // a sensor that ends there
  log.seal("short");
  EXPECT_TRUE(noticed(prepare(log.record, axis_model()), "clipped"));
}

// Stamps that jitter by up to three tenths of a sample, each for itself: neighbours may seem 1.6 samples apart, and no row is lost.
TEST(Record, JitteringStampsOfAUniformClockLoseNoRow) {
  Log log = run_axis({}, 8, 5);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> jitter(-0.3, 0.3);
  for (auto &t : log.t_ns) t += std::int64_t(2e6 * jitter(random));
  log.seal("jitter");
  Prepared p = prepare(log.record, axis_model());
  EXPECT_TRUE(noticed(p, "jitter"));
  EXPECT_FALSE(noticed(p, "lost_rows"));
  ASSERT_EQ(p.pieces.size(), 1u);
  const auto &x = p.pieces[0].signal.at("theta_rad");
  ASSERT_EQ(x.size(), log.theta_rad.size());
  for (std::size_t k = 0; k < x.size(); ++k) ASSERT_NEAR(x[k], log.theta_rad[k], 0.02) << k;   // the mean step is that exact: a hundredth of a sample over 8 s
}

// A drive's own speed, made of counts and filtered, comes back as the difference of the counts; a tachometer's stays as it is.
TEST(Record, FilterOfADriveOwnSpeedIsUndone) {
  Log log = run_axis({}, 6, 6);
  std::vector<double> counts = log.theta_rad, filtered(counts.size(), 0.0), difference(counts.size(), 0.0), tacho(counts.size(), 0.0);
  std::mt19937 rng(7);
  std::normal_distribution<double> normal;
  for (std::size_t k = 1; k < counts.size(); ++k) {
    difference[k] = (counts[k] - counts[k - 1]) / 0.002;
    filtered[k] = 0.7 * filtered[k - 1] + 0.3 * difference[k];
    tacho[k] = difference[k] + 0.05 * normal(rng);
  }
  for (bool made_of_counts : {true, false}) {
    log.columns = {{"i_A", log.i_A.data()}, {"omega_rad_s", made_of_counts ? filtered.data() : tacho.data()}};
    log.record = {"speed", nullptr, nullptr, log.t_ns.size(), log.columns.size(), log.t_ns.data(), log.columns.data()};
    Prepared p = prepare(log.record, axis_model());
    ASSERT_TRUE(p.bad.empty()) << p.bad;
    EXPECT_EQ(noticed(p, "lag"), made_of_counts);
    const auto &w = p.pieces[0].signal.at("omega_rad_s");
    const std::vector<double> &expected = made_of_counts ? difference : tacho;
    for (std::size_t k = 1; k < w.size(); ++k) ASSERT_NEAR(w[k], expected[k], 0.01 * 60) << k;   // a hundredth of the greatest speed: the ratio is read to 1e-4
  }
}

TEST(Record, RefusalsSayWhatToRecord) {
  Log log = run_axis({}, 0.05, 4);
  log.seal("short");
  EXPECT_FALSE(prepare(log.record, axis_model()).bad.empty());
}
