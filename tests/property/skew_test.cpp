// SPDX-License-Identifier: Apache-2.0
// Current-to-encoder skew as the watch sees it: drives in many small steps whose current is read before or after the encoder.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "plants.hpp"
#include <driveid/estimate.h>
#include <driveid/watch.h>

namespace {

constexpr double K_t = 0.05;
constexpr int fine = 8;

struct Case {
    double rate_Hz, skew;  // skew in sample times
    uint64_t seed;
    double noise_A = 0.005;
    bool sine = false;
    double dry_Nm = 0; // friction that the model lacks
};

driveid_watch_report run(const Case &c) {
    const double dt = 1 / c.rate_Hz, h = dt / fine, lsb = 6.2831853 / 65536;
    plants::Rng g{c.seed};
    plants::Axis axis{1.2e-4, 2e-4};
    plants::Program program{g};
    driveid_model model;
    driveid_online online;
    driveid_model_init(&model, DRIVEID_STRUCTURE_RIGID_AXIS);
    driveid_model_give(&model, "K_t_Nm_A", K_t);
    EXPECT_EQ(driveid_online_init(&online, &model, 1u << DRIVEID_SIGNAL_I_A | 1u << DRIVEID_SIGNAL_THETA_RAD, nullptr, 0), DRIVEID_OK);
    std::vector<double> room(driveid_watch_size() / sizeof(double) + 1), estimator(driveid_estimator_size("fsm", DRIVEID_F64) / sizeof(double) + 1);
    auto *w = reinterpret_cast<driveid_watch *>(room.data());
    auto *e = reinterpret_cast<driveid_estimator *>(estimator.data());
    driveid_estimator_options o{};
    o.dt_s = dt;
    EXPECT_EQ(driveid_watch_init(w, &online, dt), DRIVEID_OK);
    EXPECT_EQ(driveid_estimator_configure(e, estimator.size() * sizeof(double), "fsm", DRIVEID_F64, &online.regression, &o, nullptr, 0), DRIVEID_OK);
    std::vector<double> i_A{0}, theta;
    double i = 0;
    const int lag = 4, samples = int((c.rate_Hz < 500 ? 300 : 200) * c.rate_Hz); // half of it rests
    for (int k = 0; k < samples + lag; k++) {
        theta.push_back(std::round((axis.theta + 5e-5 * plants::gauss(g)) / lsb) * lsb);
        for (int f = 0; f < fine; f++) {
            const double t = k * dt + f * h;
            const double asked = c.sine ? 0.02 * std::sin(30 * t) : std::fmax(-0.5, std::fmin(0.5, 0.15 * (program.target(t) - axis.theta) - 0.006 * axis.omega));
            const double before = i;
            i += (asked / K_t - i) * (1 - std::exp(-2000 * h));
            axis.step(K_t * 0.5 * (before + i) - c.dry_Nm * std::tanh(axis.omega / 0.05), h);
            i_A.push_back(i);
        }
        const int n = k - lag; // the current's reading with this stamp may be one from after it
        if (n < lag) continue;
        const double at = (n - c.skew) * fine, part = at - std::floor(at);
        const size_t a = size_t(at);
        driveid_sample s{};
        s.stamp.t_ns = 1 + std::llround(n * dt * 1e9);
        s.present = online.present;
        s.value[DRIVEID_SIGNAL_THETA_RAD] = theta[size_t(n)];
        s.value[DRIVEID_SIGNAL_I_A] = i_A[a] * (1 - part) + i_A[a + 1] * part + c.noise_A * plants::gauss(g);
        driveid_watch_sample(w, &s);
        double channel[DRIVEID_CHANNELS_MAX];
        if (driveid_online_channels(&online, &s, channel) == DRIVEID_OK) driveid_estimator_update(e, online.t_ns, channel);
        driveid_estimate answer;
        const driveid_status status = n % 25 ? DRIVEID_NOT_YET : driveid_estimator_estimate(e, &answer);
        if (status == DRIVEID_OK || status == DRIVEID_FROZEN) driveid_watch_estimate(w, &answer, status);
    }
    return *driveid_watch_answer(w);
}

TEST(Skew, EitherSignBelowASampleTimeWithAnIntervalThatHolds) {
    int known = 0, covered = 0, all = 0;
    double width = 0;
    for (double rate_Hz : {250.0, 1000.0})
        for (double skew : {-0.4, -0.1, 0.25})
            for (uint64_t seed = 1; seed <= 4; seed++, all++) {
                const driveid_watch_report r = run({rate_Hz, skew, seed});
                if (!r.skew_known) continue;
                known++;
                width += r.skew_half_s * rate_Hz;
                covered += std::fabs(r.skew_s * rate_Hz - skew) <= r.skew_half_s * rate_Hz;
                EXPECT_NEAR(r.skew_s * rate_Hz, skew, 2.5 * r.skew_half_s * rate_Hz) << rate_Hz << " Hz, seed " << seed;
            }
    EXPECT_GE(known, all / 2);
    EXPECT_GE(covered, known - 3); // 95 %: more than 3 of 24 outside once in 100 runs
    EXPECT_LT(width / known, 0.15); // 0.005 A of noise
    std::printf("%d of %d known, %d covered, mean half-width %.2f sample times\n", known, all, covered, width / known);
}

TEST(Skew, WithoutNoiseOfTheCurrentToAFewHundredthsOfASample) {
    for (double skew : {-0.3, 0.45}) {
        const driveid_watch_report r = run({1000, skew, 4, 0});
        ASSERT_TRUE(r.skew_known);
        EXPECT_LT(r.skew_half_s * 1000, 0.05);
        EXPECT_NEAR(r.skew_s * 1000, skew, 2 * r.skew_half_s * 1000);
    }
}

// In one sine the slope of the current is the speed's own shape: friction and skew are one.
TEST(Skew, ASinusoidalMotionDoesNotTellIt) {
    for (double skew : {0.0, 0.3}) EXPECT_FALSE(run({1000, skew, 1, 0.005, true}).skew_known);
}

// Dry friction of 0.4 to 8 % of the torque that the model lacks is no skew: told rightly or not at all.
TEST(Skew, FrictionThatTheModelLacksIsNotTakenForIt) {
    int known = 0;
    for (double dry_Nm : {0.002, 0.005, 0.01, 0.04})
        for (uint64_t seed = 4; seed < 8; seed++) {
            const driveid_watch_report r = run({1000, 0.2, seed, 0.005, false, dry_Nm});
            if (!r.skew_known) continue;
            known++;
            EXPECT_NEAR(r.skew_s * 1000, 0.2, 1.5 * r.skew_half_s * 1000) << dry_Nm << " Nm, seed " << seed;
        }
    EXPECT_GE(known, 4);
}

} // namespace
