// SPDX-License-Identifier: Apache-2.0
// Hundreds of random drives outside the cells of docs/intervals.md: sample rates of 250 Hz to 4 kHz, jitter of the stamps, lost samples and gaps, any strength of
// motion and noise. A parameter called valid lies inside its interval as often as stated and near the truth; one that is not is named weak, and is bad.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "axis.hpp"
#include "plants.hpp"

namespace {

struct Tally { int valid[2] = {0, 0}, inside[2] = {0, 0}, weak[2] = {0, 0}, weak_good[2] = {0, 0}, silent = 0; double worst[2] = {0, 0}; };

void run(uint64_t seed, Tally &tally) {
    plants::Rng g(seed * 104729);
    const double rate_Hz = plants::log_uniform(g, 250, 4000), h = 1 / rate_Hz;
    plants::Axis axis{plants::log_uniform(g, 1e-6, 1e-1), 0};
    axis.B = axis.J * plants::log_uniform(g, 0.3, 10);
    axis.omega = plants::uniform(g, -20, 20);
    const double sigma = plants::log_uniform(g, 1e-5, 3e-2), strength = plants::log_uniform(g, 1, 300), jitter = plants::uniform(g, 0, 0.2) * h;
    const double f1 = plants::uniform(g, 0.2, 2), f2 = plants::uniform(g, 1, 5), span_s = plants::uniform(g, 2, 8), loss = plants::uniform(g, 0, 0.02);
    driveid_estimator_options o{};
    o.dt_s = h;
    plants::AxisEstimator e(o);
    ASSERT_EQ(e.reason, "");
    double next_gap = plants::uniform(g, 1.5, 6), stamp = 0;
    for (double t = 0; t < span_s;) {
        const double until = stamp + h + (jitter > 0 ? plants::uniform(g, -jitter, jitter) : 0);
        const double tau = axis.J * strength * (std::sin(6.2832 * f1 * t) + std::sin(6.2832 * f2 * t));
        const double channel[2] = {axis.theta + sigma * plants::gauss(g), tau};
        const bool gone = plants::uniform(g, 0, 1) < loss || (t > next_gap && t < next_gap + 0.3); // a lost sample: its torque is not known either
        if (!gone) {
            ASSERT_GE(driveid_estimator_update(e.get(), 1 + llround(t * 1e9), channel), 0);
        } else driveid_estimator_gap(e.get());
        axis.step(tau, until - t);
        stamp += h, t = until;
    }
    driveid_estimate a{};
    const driveid_status s = driveid_estimator_estimate(e.get(), &a);
    if (s != DRIVEID_OK && s != DRIVEID_WEAK_EXCITATION && s != DRIVEID_RANK && s != DRIVEID_FROZEN) return void(tally.silent++);
    const double truth[2] = {axis.J, axis.B};
    for (int i = 0; i < 2; i++) {
        const double error = std::fabs(a.theta[i] / truth[i] - 1);
        ASSERT_NE(a.valid_mask >> i & 1, a.weak_mask >> i & 1);
        if (a.valid_mask >> i & 1) {
            tally.valid[i]++, tally.inside[i] += a.lo[i] <= truth[i] && truth[i] <= a.hi[i];
            tally.worst[i] = std::fmax(tally.worst[i], error);
        } else tally.weak[i]++, tally.weak_good[i] += (a.hi[i] - a.lo[i]) / 2 < 0.1 * truth[i];
    }
}

TEST(RandomDrives, RecoveredOrNamedWeak) {
    Tally t;
    const int runs = 400;
    for (uint64_t seed = 1; seed <= runs; seed++) run(seed, t);
    for (int i = 0; i < 2; i++)
        std::printf("%s: valid %d, inside %.1f %%, worst error %.3g %%; weak %d\n", i ? "B" : "J", t.valid[i], 100.0 * t.inside[i] / t.valid[i], 100 * t.worst[i], t.weak[i]);
    std::printf("no answer: %d\n", t.silent);
    for (int i = 0; i < 2; i++) {
        EXPECT_GT(t.valid[i], runs / 2);
        EXPECT_GT(t.inside[i], t.valid[i] * (0.95 - 3 * std::sqrt(0.95 * 0.05 / t.valid[i]))); // three standard deviations of a count
        EXPECT_EQ(t.weak_good[i], 0);
        EXPECT_LT(t.worst[i], 0.6); // an interval of half the value is where a parameter becomes weak
    }
    EXPECT_LT(t.silent, runs / 20);
}

} // namespace
