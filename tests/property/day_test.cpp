// SPDX-License-Identifier: Apache-2.0
// A working day: 8 hours of drive time at 250 Hz, generated on the fly. Point-to-point moves and rests, a -20 % and a -5 % change of the load's
// inertia, a gap. Every change is found, there is no false alarm, memory is flat (the estimator is one struct), and the times are printed.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <vector>

#include "axis.hpp"
#include "plants.hpp"
#include <driveid/estimate.h>

namespace {

using plants::Program;
using plants::Rng;
constexpr double dt = 4e-3, hours = 8;

TEST(WorkingDay, EveryChangeFoundNoFalseAlarm) {
    Rng g(20240607);
    const double J0 = 1.2e-4, lsb = 6.2831853 / 65536;
    plants::Axis axis{J0, 2e-4};
    Program program{g};
    driveid_estimator_options o{};
    o.dt_s = dt;
    plants::AxisEstimator estimator(o);
    driveid_estimator *e = estimator.get();
    ASSERT_EQ(estimator.reason, "");

    struct Change { double at, factor; bool found = false; double moving = 0, settled = -1; };
    std::vector<Change> changes{{2.3 * 3600, 0.8}, {5.1 * 3600, 0.95}};
    const double gap_at = 4 * 3600;
    uint32_t restarts = 0, expected = 0;
    double J = J0, worst = 0;
    std::size_t next = 0;
    driveid_estimate a{};
    const int64_t samples = int64_t(hours * 3600 / dt);
    for (int64_t k = 0; k < samples; k++) {
        const double t = k * dt;
        if (next < changes.size() && t >= changes[next].at) J *= changes[next].factor, axis.J = J, next++, expected++;
        const double measured = std::round((axis.theta + 5e-5 * plants::gauss(g)) / lsb) * lsb;
        const double target = program.target(t);
        const double tau = std::fmax(-0.5, std::fmin(0.5, 0.15 * (target - axis.theta) - 0.006 * axis.omega));
        const bool silent = t > gap_at && t < gap_at + 2;
        const double channel[2] = {measured, tau};
        if (!silent) {
            const driveid_status s = driveid_estimator_update(e, 1 + llround(t * 1e9), channel);
            ASSERT_GE(s, 0);
        }
        axis.step(tau, dt);
        if (k % 5) continue;
        const driveid_status s = driveid_estimator_estimate(e, &a);
        if (next > 0) {
            Change &c = changes[next - 1];
            if (std::fabs(axis.omega) > 0.5 && c.settled < 0) c.moving += 5 * dt;
            if (c.settled < 0 && s == DRIVEID_OK && std::fabs(a.theta[0] / J - 1) < 0.02 && a.restarts >= expected) c.settled = t - c.at;
        }
        if (a.restarts != restarts) {
            ASSERT_LE(a.restarts, expected) << "false alarm at " << t << " s";
            restarts = a.restarts;
        }
        const bool calm = next == 0 ? t > 20 : t > changes[next - 1].at + 600;
        if (calm && s == DRIVEID_OK) worst = std::fmax(worst, std::fabs(a.theta[0] / J - 1));
    }
    EXPECT_EQ(restarts, expected);
    for (const Change &c : changes) {
        EXPECT_GE(c.settled, 0) << c.factor;
        EXPECT_LT(c.moving, 3) << c.factor;
        std::printf("inertia x %.2f: within 2 %% after %.2f s, of these %.2f s in motion\n", c.factor, c.settled, c.moving);
    }
    EXPECT_LT(worst, 0.01);
    std::printf("largest error of J away from changes: %.3f %%; state %zu bytes\n", 100 * worst, estimator.memory.size());
}

} // namespace
