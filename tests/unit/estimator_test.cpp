// SPDX-License-Identifier: Apache-2.0
// The estimator's front: refusals, bad samples, gaps, snapshot, restart, number types.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <vector>

#include "axis.hpp"
#include "plants.hpp"
#include <driveid/estimate.h>

namespace {

using plants::Rng;
constexpr int64_t ms = 1000000;

using plants::axis_regression;

driveid_estimator_options at_1_kHz(driveid_estimator_options o) { return o.dt_s = 1e-3, o; }

struct Estimator : plants::AxisEstimator {
    explicit Estimator(driveid_real type = DRIVEID_F64, const driveid_estimator_options &options = {}) : AxisEstimator(at_1_kHz(options), "fsm", type) { EXPECT_EQ(reason, ""); }
    driveid_status feed(int64_t t_ns, double theta, double tau) {
        const double channel[2] = {theta, tau};
        return driveid_estimator_update(get(), t_ns, channel);
    }
    driveid_estimate ask(driveid_status expected = DRIVEID_OK) {
        driveid_estimate e{};
        EXPECT_EQ(driveid_estimator_estimate(get(), &e), expected);
        return e;
    }
};

double torque(double t) { return 0.02 * std::sin(5 * t) + 0.02 * std::sin(13 * t); }

struct Drive {
    Rng g{5};
    plants::Axis axis{1.2e-4, 2e-4};
    int k = 0;
    double theta() { return axis.theta + 1e-4 * plants::gauss(g); }
    void feed(Estimator &e, int samples) {
        for (int n = 0; n < samples; n++, k++) {
            e.feed(1 + k * ms, theta(), torque(k * 1e-3));
            axis.step(torque(k * 1e-3), 1e-3);
        }
    }
};

TEST(Estimator, RefusesWithAReason) {
    Estimator e;
    char reason[200];
    driveid_regression r = axis_regression();
    driveid_estimator_options o{};
    auto refused = [&](const char *word) {
        reason[0] = 0;
        EXPECT_EQ(driveid_estimator_configure(e.get(), e.memory.size(), "fsm", DRIVEID_F64, &r, &o, reason, sizeof reason), DRIVEID_ERR_CONFIG);
        EXPECT_NE(std::strstr(reason, word), nullptr) << reason;
    };
    refused("dt_s");
    o.dt_s = 1e-3;
    o.bandwidth_rad_s = 5000;
    refused("bandwidth_rad_s");
    o.bandwidth_rad_s = 0;
    r.term[2].param = 0;
    refused("known");
    r = axis_regression();
    r.term[1].param = 0;
    refused("parameter has no term");
    r = axis_regression();
    r.term[0].channel = 7;
    refused("channel");
    r = axis_regression();
    r.term[0].factor = std::nan("");
    refused("factor");
    r = axis_regression();
    EXPECT_EQ(driveid_estimator_size("magic", DRIVEID_F64), 0u);
    EXPECT_EQ(driveid_estimator_configure(e.get(), e.memory.size(), "magic", DRIVEID_F64, &r, &o, reason, sizeof reason), DRIVEID_ERR_CONFIG);
    EXPECT_EQ(driveid_estimator_configure(e.get(), 100, "fsm", DRIVEID_F64, &r, &o, reason, sizeof reason), DRIVEID_ERR_CAPACITY);
    EXPECT_EQ(driveid_estimator_configure(nullptr, 0, "fsm", DRIVEID_F64, &r, &o, nullptr, 0), DRIVEID_ERR_ARGUMENT);
}

TEST(Estimator, BadSamplesAreNamedAndChangeNothing) {
    Estimator clean, dirty;
    Drive a, b;
    EXPECT_EQ(dirty.feed(0, 0, 0), DRIVEID_NOT_YET);
    dirty = Estimator();
    for (int n = 0; n < 30; n++) {
        a.feed(clean, 100);
        b.feed(dirty, 100);
        const int64_t last = 1 + (b.k - 1) * ms;
        EXPECT_EQ(dirty.feed(last, 9, 9), DRIVEID_DUPLICATE);
        EXPECT_EQ(dirty.feed(last - 5 * ms, 9, 9), DRIVEID_ERR_TIME);
        EXPECT_EQ(dirty.feed(last + 1, std::nan(""), 0), DRIVEID_ERR_VALUE);
        EXPECT_EQ(dirty.feed(last + 1, 0, std::numeric_limits<double>::infinity()), DRIVEID_ERR_VALUE);
    }
    const auto x = clean.ask(), y = dirty.ask(); // to the last bit
    for (int i = 0; i < 2; i++) {
        EXPECT_EQ(x.theta[i], y.theta[i]);
        EXPECT_EQ(x.lo[i], y.lo[i]);
        EXPECT_EQ(x.hi[i], y.hi[i]);
    }
    EXPECT_EQ(x.t_ns, y.t_ns);
}

TEST(Estimator, SnapshotIsACopy) {
    for (driveid_real type : {DRIVEID_F64, DRIVEID_F32}) {
        Estimator e(type);
        Drive run;
        run.feed(e, 2345);
        Estimator copy = e;
        Drive again = run;
        run.feed(e, 3210);
        again.feed(copy, 3210);
        EXPECT_EQ(e.memory, copy.memory);
    }
}

TEST(Estimator, FloatAgreesWithDouble) {
    for (int seed = 1; seed <= 20; seed++) {
        Estimator d(DRIVEID_F64), f(DRIVEID_F32);
        Drive a, b;
        a.g.seed(seed), b.g.seed(seed);
        a.feed(d, 8000), b.feed(f, 8000);
        const auto x = d.ask(), y = f.ask();
        for (int i = 0; i < 2; i++) // float's share stays well inside the interval
            EXPECT_NEAR(y.theta[i], x.theta[i], 0.25 * (x.hi[i] - x.lo[i]) / 2) << seed << ' ' << i;
    }
}

TEST(Estimator, GapRestartsTheFiltersAndKeepsWhatWasLearnt) {
    Estimator e;
    Drive run;
    run.feed(e, 6000);
    const auto before = e.ask();
    run.k += 3000; // three seconds of silence, the drive moves on unseen
    run.axis.omega = -7, run.axis.theta += 100;
    EXPECT_EQ(e.feed(1 + run.k * ms, run.theta(), torque(run.k * 1e-3)), DRIVEID_GAP);
    run.axis.step(torque(run.k * 1e-3), 1e-3);
    run.k++;
    run.feed(e, 40);
    const auto after = e.ask();
    for (int i = 0; i < 2; i++) EXPECT_NEAR(after.theta[i], before.theta[i], (before.hi[i] - before.lo[i])) << i;
    run.feed(e, 6000);
    const auto late = e.ask();
    EXPECT_NEAR(late.theta[0], 1.2e-4, 1.2e-4 * 2e-3);
    EXPECT_EQ(late.restarts, 0u);
}

TEST(Estimator, AGapThatIsToldIsAGapHoweverShort) {
    Estimator e;
    Drive run;
    run.feed(e, 6000);
    run.axis.omega = -7, run.axis.theta += 100; // what the lost samples would have said
    run.k += 2;                                 // far below gap_s
    driveid_estimator_gap(e.get());
    EXPECT_EQ(e.feed(1 + run.k * ms, run.theta(), torque(run.k * 1e-3)), DRIVEID_GAP);
    run.axis.step(torque(run.k * 1e-3), 1e-3);
    run.k++;
    run.feed(e, 6000);
    const auto after = e.ask();
    EXPECT_NEAR(after.theta[0], 1.2e-4, 1.2e-4 * 2e-3);
    EXPECT_EQ(after.restarts, 0u);
}

TEST(Estimator, StampsMayJitterAndSkip) {
    Estimator e;
    Rng g(3);
    plants::Axis axis{1.2e-4, 2e-4};
    int64_t t = 0;
    for (int k = 0; k < 8000; k++) { // 20 % jitter, every tenth sample lost; torque held between stamps
        const int64_t dt = int64_t(1e6 * plants::uniform(g, 0.8, 1.2)) * (plants::uniform(g, 0, 1) < 0.1 ? 2 : 1);
        const double tau = torque(t * 1e-9);
        EXPECT_GE(e.feed(1 + t, axis.theta + 1e-4 * plants::gauss(g), tau), 0);
        axis.step(tau, dt * 1e-9);
        t += dt;
    }
    const auto a = e.ask();
    EXPECT_NEAR(a.theta[0], 1.2e-4, 1.2e-4 * 1e-3);
    EXPECT_NEAR(a.theta[1], 2e-4, 2e-4 * 1e-3);
}

TEST(Estimator, RestChangesNothing) {
    Estimator e;
    Drive run;
    run.feed(e, 6000);
    const auto before = e.ask();
    for (int k = 0; k < 1000; k++, run.k++) { // brought to a stand
        const double tau = -0.003 * run.axis.omega;
        e.feed(1 + run.k * ms, run.theta(), tau);
        run.axis.step(tau, 1e-3);
    }
    run.axis.omega = 0;
    driveid_status last = DRIVEID_OK;
    for (int k = 0; k < 600000; k++, run.k++) last = e.feed(1 + run.k * ms, run.axis.theta + 1e-4 * plants::gauss(run.g), 0); // ten minutes
    EXPECT_EQ(last, DRIVEID_FROZEN);
    const auto after = e.ask(DRIVEID_FROZEN);
    for (int i = 0; i < 2; i++) EXPECT_NEAR(after.theta[i], before.theta[i], before.hi[i] - before.lo[i]);
    EXPECT_EQ(after.restarts, 0u);
    run.feed(e, 3000);
    const auto again = e.ask();
    EXPECT_NEAR(again.theta[0], 1.2e-4, 1.2e-4 * 1e-3);
}

TEST(Estimator, RestartForgets) {
    Estimator e;
    Drive run;
    run.feed(e, 4000);
    e.ask();
    driveid_estimator_restart(e.get());
    e.ask(DRIVEID_NOT_YET);
    run.axis.J = 3e-4;
    run.feed(e, 4000);
    EXPECT_NEAR(e.ask().theta[0], 3e-4, 3e-4 * 1e-3);
}

} // namespace
