// SPDX-License-Identifier: Apache-2.0
// The watch over a working day: 8 hours at 250 Hz with moves, rests and a gap, and no false alarm; then the load's inertia rises by 20 %, which
// is named, and the alarm ends once the estimate has followed.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <vector>

#include "plants.hpp"
#include <driveid/estimate.h>
#include <driveid/watch.h>

namespace {

constexpr double dt = 4e-3, hours = 8, K_t = 0.05;

struct Bench {
    plants::Rng g{20240608};
    plants::Axis axis{1.2e-4, 2e-4};
    plants::Program program{g};
    driveid_online online{};
    std::vector<double> estimator, watch;
    int64_t k = 0;
    driveid_estimate answer{};

    Bench() {
        driveid_model model;
        char reason[200];
        driveid_model_init(&model, DRIVEID_STRUCTURE_RIGID_AXIS);
        driveid_model_give(&model, "K_t_Nm_A", K_t);
        EXPECT_EQ(driveid_online_init(&online, &model, 1u << DRIVEID_SIGNAL_I_A | 1u << DRIVEID_SIGNAL_THETA_RAD, reason, sizeof reason), DRIVEID_OK) << reason;
        driveid_online_hold(&online, DRIVEID_SIGNAL_I_A, DRIVEID_HOLD_ZERO);
        estimator.resize(driveid_estimator_size("fsm", DRIVEID_F64) / sizeof(double) + 1);
        watch.resize(driveid_watch_size() / sizeof(double) + 1);
        driveid_estimator_options o{};
        o.dt_s = dt;
        EXPECT_EQ(driveid_estimator_configure(e(), estimator.size() * sizeof(double), "fsm", DRIVEID_F64, &online.regression, &o, reason, sizeof reason), DRIVEID_OK) << reason;
        EXPECT_EQ(driveid_watch_init(w(), &online, dt), DRIVEID_OK);
    }
    driveid_estimator *e() { return reinterpret_cast<driveid_estimator *>(estimator.data()); }
    driveid_watch *w() { return reinterpret_cast<driveid_watch *>(watch.data()); }
    const driveid_watch_report &report() { return *driveid_watch_answer(w()); }

    // One sample, as the daemon hands it on; silent: the sample is lost.
    void step(bool silent) {
        const double t = double(k) * dt, lsb = 6.2831853 / 65536;
        driveid_sample s{};
        s.stamp.t_ns = 1 + llround(t * 1e9);
        s.present = online.present;
        s.value[DRIVEID_SIGNAL_THETA_RAD] = std::round((axis.theta + 5e-5 * plants::gauss(g)) / lsb) * lsb;
        const double tau = std::fmax(-0.5, std::fmin(0.5, 0.15 * (program.target(t) - axis.theta) - 0.006 * axis.omega));
        s.value[DRIVEID_SIGNAL_I_A] = tau / K_t;
        double channel[DRIVEID_CHANNELS_MAX];
        if (!silent) {
            driveid_watch_sample(w(), &s);
            if (driveid_online_channels(&online, &s, channel) == DRIVEID_OK) driveid_estimator_update(e(), online.t_ns, channel);
        }
        axis.step(tau, dt);
        if (++k % 25) return;
        const driveid_status status = driveid_estimator_estimate(e(), &answer);
        if (status == DRIVEID_OK || status == DRIVEID_FROZEN || status == DRIVEID_WEAK_EXCITATION) driveid_watch_estimate(w(), &answer, status);
    }
};

TEST(Watch, WorkingDayWithoutFalseAlarmThenInertiaIsNamed) {
    Bench b;
    const int64_t day = int64_t(hours * 3600 / dt);
    while (b.k < day) {
        const double t = double(b.k) * dt;
        b.step(t > 4 * 3600 && t < 4 * 3600 + 2);
        ASSERT_FALSE(b.report().mismatch) << "after " << t << " s: " << b.report().effect;
    }
    EXPECT_TRUE(b.report().ready);
    b.axis.J *= 1.2;
    double moving = 0;
    while (!b.report().mismatch && moving < 10) {
        b.step(false);
        if (std::fabs(b.axis.omega) > 0.5) moving += dt;
    }
    ASSERT_TRUE(b.report().mismatch) << "not seen in 10 s of motion";
    EXPECT_STREQ(b.report().effect, "inertia_change");
    EXPECT_GE(b.report().since_ns, llround(hours * 3600e9));
    for (moving = 0; b.report().mismatch && moving < 60;) {
        b.step(false);
        if (std::fabs(b.axis.omega) > 0.5) moving += dt;
    }
    EXPECT_FALSE(b.report().mismatch) << "the estimate has followed, the alarm has not ended";
}

} // namespace
