// SPDX-License-Identifier: Apache-2.0
// All subsets of excitation: either the truth is recovered, or the status names the weak parameter and its estimate is shown to be bad.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "plants.hpp"
#include <driveid/estimate.h>

namespace {

using plants::Rng;

struct Outcome {
    driveid_status status;
    driveid_estimate e;
};

// bits: 1 slow torque, 2 fast torque, 4 constant torque, 8 initial speed; model J, B, tau_0
Outcome run(int subset, uint64_t seed, const plants::Axis &truth) {
    Rng g(seed);
    plants::Axis axis = truth;
    axis.omega = subset & 8 ? 30 : 0;
    driveid_regression r{};
    r.equations = 1, r.channels = 3, r.params = 3, r.terms = 4, r.may_be_zero = 0b110;
    r.hold[1] = DRIVEID_HOLD_ZERO;
    r.term[0] = {0, 0, 2, 0, 1};
    r.term[1] = {0, 0, 1, 1, 1};
    r.term[2] = {0, 2, 0, 2, 1};
    r.term[3] = {0, 1, 0, DRIVEID_TERM_KNOWN, -1};
    driveid_estimator_options o{};
    o.dt_s = 1e-3;
    std::vector<unsigned char> memory(driveid_estimator_size("fsm", DRIVEID_F64));
    auto *e = reinterpret_cast<driveid_estimator *>(memory.data());
    EXPECT_EQ(driveid_estimator_configure(e, memory.size(), "fsm", DRIVEID_F64, &r, &o, nullptr, 0), DRIVEID_OK);
    for (int k = 0; k < 6000; k++) {
        const double t = k * 1e-3;
        const double tau = axis.J * ((subset & 1 ? 100 * std::sin(5 * t) : 0) + (subset & 2 ? 200 * std::sin(21 * t) : 0) + (subset & 4 ? 20 : 0));
        const double channel[3] = {axis.theta + 1e-3 * plants::gauss(g), tau, 1};
        driveid_estimator_update(e, 1 + k * INT64_C(1000000), channel);
        axis.step(tau, 1e-3);
    }
    Outcome out{};
    out.status = driveid_estimator_estimate(e, &out.e);
    return out;
}

TEST(Excitation, EverySubsetIsRecoveredOrRefused) {
    int recovered = 0, refused = 0;
    for (int subset = 0; subset < 16; subset++)
        for (uint64_t seed = 1; seed <= 6; seed++) {
            SCOPED_TRACE(testing::Message() << "subset " << subset << " seed " << seed);
            const plants::Axis truth{1.5e-4, 3e-4, 0, 2e-3};
            const Outcome out = run(subset, seed, truth);
            const double theta[3] = {truth.J, truth.B, truth.tau_0};
            ASSERT_GE(out.status, 0);
            if (out.status == DRIVEID_NOT_YET) continue;
            for (int i = 0; i < 3; i++) {
                const double half = (out.e.hi[i] - out.e.lo[i]) / 2;
                ASSERT_NE(out.e.valid_mask >> i & 1, out.e.weak_mask >> i & 1);
                if (out.e.valid_mask >> i & 1) {
                    recovered++;
                    // three half-widths are nearly six sigma; a valid one is never more than half its value off
                    EXPECT_NEAR(out.e.theta[i], theta[i], 3 * half) << i;
                } else {
                    refused++;
                    EXPECT_TRUE(out.status == DRIVEID_WEAK_EXCITATION || out.status == DRIVEID_RANK);
                    EXPECT_TRUE(out.status == DRIVEID_RANK || half > 0.4 * std::fabs(out.e.theta[i]) || std::fabs(out.e.theta[i] / theta[i] - 1) > 0.1) << i << ' ' << out.e.theta[i] << " +- " << half;
                }
            }
            if ((subset & 3) == 3) {
                EXPECT_EQ(out.status, DRIVEID_OK); // rich motion must be enough
            }
        }
    EXPECT_GT(recovered, 100);
    EXPECT_GT(refused, 5);
}

} // namespace
