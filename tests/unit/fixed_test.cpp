// SPDX-License-Identifier: Apache-2.0
// Fixed point against f64: error as SNR and in units of the last bit, saturation counted, refusals with a reason, and one trajectory of sums whose
// digest is the same on host and target.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "axis.hpp"
#include "plants.hpp"
#include <driveid/estimate.h>
#include <driveid/frequency.h>
extern "C" {
#include "base/fixed.h"
#include "estimate/q31.h"
}

namespace {

driveid_estimator_options ranged(double theta, double tau) {
    driveid_estimator_options o{};
    o.dt_s = 1e-3, o.range[0] = theta, o.range[1] = tau;
    return o;
}

struct Estimator : plants::AxisEstimator {
    Estimator(const char *method, driveid_real type, double range_theta, double range_tau) : AxisEstimator(ranged(range_theta, range_tau), method, type) { EXPECT_EQ(reason, ""); }
};

TEST(Fixed, SaturationIsCounted) {
    uint32_t count = 0;
    EXPECT_EQ(fixed_saturate(INT64_C(1) << 40, &count), INT32_MAX);
    EXPECT_EQ(fixed_saturate(-(INT64_C(1) << 40), &count), INT32_MIN);
    EXPECT_EQ(fixed_saturate(-5, &count), -5);
    EXPECT_EQ(count, 2u);
    EXPECT_EQ(fixed_round(3, 1), 2);
    EXPECT_EQ(fixed_round(-3, 1), -1); // half up
    EXPECT_EQ(fixed_q31(1), INT32_MAX);
    EXPECT_EQ(fixed_q31(-0.5), -(1 << 30));
}

// The same bank in f64 and in q31 on the same samples: rows of the second derivative, the first and the known side.
TEST(Fixed, RowsAgainstF64) {
    for (const q31_kind kind : {Q31_FSM, Q31_WINDOW, Q31_DISCRETE}) {
        static q31_state q;
        const driveid_regression r = plants::axis_regression();
        driveid_estimator_options o{};
        o.dt_s = 1e-3, o.range[0] = 8, o.range[1] = 0.1;
        ASSERT_EQ(q31_configure(&q, kind, &r, &o, nullptr, 0), DRIVEID_OK);
        std::vector<double> theta, tau;
        double power[3] = {}, wrong[3] = {}, worst[3] = {};
        static kernel_f64 k;
        static const learn_method *method = kind == Q31_WINDOW ? &window_method_f64 : &discrete_method_f64;
        method = kind == Q31_WINDOW ? &window_method_f64 : &discrete_method_f64;
        driveid_estimator_options wide = o;
        wide.bandwidth_rad_s = 100; // its first window is as long as the one of q31 at 200
        driveid_bank_f64 bank;
        const uint8_t level[2] = {0, 1};
        if (kind == Q31_FSM) driveid_bank_init_f64(&bank, 2, 4, 200, r.hold, level);
        else ASSERT_EQ(learn_configure(&k.base, method, &r, &wide, nullptr, 0), DRIVEID_OK);
        for (int n = 0; n < 4000; n++) {
            const double t = n * 1e-3, channel[2] = {3 * std::sin(6 * t) + std::sin(17 * t + 1), 0.05 * std::sin(9 * t)};
            int32_t count[2], row[FSM_COLUMNS_MAX];
            for (int c = 0; c < 2; c++) count[c] = int32_t(std::lrint(channel[c] * q.count_per_SI[c]));
            if (n == 0) {
                q.common.running = 1;
                q31_filter_start(&q, count);
                if (kind == Q31_FSM) driveid_bank_start_f64(&bank, channel, nullptr);
                else method->start(&k.base, channel);
                continue;
            }
            q31_filter_step(&q, count);
            if (kind == Q31_FSM) driveid_bank_step_f64(&bank, 1000000, channel, nullptr);
            else method->step(&k.base, 1000000, channel);
            if (n < 500) continue;
            double exact[3];
            if (kind == Q31_FSM) exact[0] = driveid_bank_value_f64(&bank, 0, 2), exact[1] = driveid_bank_value_f64(&bank, 0, 1), exact[2] = driveid_bank_value_f64(&bank, 1, 0);
            else ASSERT_EQ(method->row(&k.base, 0, 0, exact), 1);
            ASSERT_EQ(q31_row(&q, 0, row), 1);
            for (int i = 0; i < 3; i++) {
                const unsigned at = i == 2 ? q.common.equation[0].columns - 1u : unsigned(i);
                const double lsb = q.scale[0][at], error = row[at] * lsb - exact[i];
                power[i] += exact[i] * exact[i], wrong[i] += error * error;
                worst[i] = std::max(worst[i], std::fabs(error) / lsb);
            }
        }
        const bool filters = kind == Q31_FSM;
        const double least_dB[3] = {filters ? 105. : 140., filters ? 135. : 155., filters ? 165. : 170.}, most_lsb[3] = {filters ? 512. : 8., filters ? 32. : 4., 4};
        for (int i = 0; i < 3; i++) {
            const double snr = 10 * std::log10(power[i] / wrong[i]);
            static const char *const rows[] = {"fsm, rls", "", "window", "discrete"};
            std::printf("| %s | %d | %.0f dB (at least %.0f), %.1f LSB (below %.0f) |\n", rows[kind], i, snr, least_dB[i], worst[i], most_lsb[i]); // tests/target/target.py reads it
            EXPECT_GT(snr, least_dB[i]);
            EXPECT_LT(worst[i], most_lsb[i]);
        }
        EXPECT_EQ(q.saturations, 0u);
    }
}

TEST(Fixed, AnswersAgreeWithF64) {
    for (const char *method : {"fsm", "rls", "window", "discrete"}) {
        Estimator f(method, DRIVEID_F64, 8, 0.1), q(method, DRIVEID_Q31, 8, 0.1);
        plants::Axis drive{1.2e-4, 2e-4};
        plants::Rng g(3);
        for (int n = 0; n < 5000; n++) {
            const double t = n * 1e-3, tau = 0.02 * std::sin(5 * t) + 0.02 * std::sin(13 * t), channel[2] = {drive.theta + 1e-4 * plants::gauss(g), tau};
            driveid_estimator_update(f.get(), 1 + int64_t(n) * 1000000, channel);
            driveid_estimator_update(q.get(), 1 + int64_t(n) * 1000000, channel);
            drive.step(tau, 1e-3);
        }
        driveid_estimate a{}, b{};
        ASSERT_EQ(driveid_estimator_estimate(f.get(), &a), DRIVEID_OK);
        ASSERT_EQ(driveid_estimator_estimate(q.get(), &b), DRIVEID_OK) << method;
        std::printf("%-8s J: f64 %.4e +- %.1e, q31 %.4e +- %.1e, truth 1.2000e-04; saturations %u\n", method, a.theta[0], (a.hi[0] - a.lo[0]) / 2, b.theta[0],
                    (b.hi[0] - b.lo[0]) / 2, driveid_estimator_saturations(q.get()));
        EXPECT_NEAR(b.theta[0], 1.2e-4, 0.005 * 1.2e-4);
        EXPECT_GT(b.hi[0] - b.lo[0], 0);
        EXPECT_EQ(driveid_estimator_saturations(q.get()), 0u);
    }
}

TEST(Fixed, AnyNumberOfTurnsAndNoSilentOverflow) {
    Estimator turns("fsm", DRIVEID_Q31, 8, 0.1), small("fsm", DRIVEID_Q31, 8, 0.005);
    plants::Axis drive{1.2e-4, 2e-4};
    drive.theta = 1e6;
    for (int n = 0; n < 4000; n++) {
        const double t = n * 1e-3, tau = 0.02 * std::sin(5 * t) + 0.02 * std::sin(13 * t) + 0.02, channel[2] = {drive.theta, tau};
        driveid_estimator_update(turns.get(), 1 + int64_t(n) * 1000000, channel);
        driveid_estimator_update(small.get(), 1 + int64_t(n) * 1000000, channel);
        drive.step(tau, 1e-3); // spins up: hundreds of radians
    }
    driveid_estimate e{};
    EXPECT_GT(drive.theta, 1e6 + 50);
    ASSERT_EQ(driveid_estimator_estimate(turns.get(), &e), DRIVEID_OK);
    EXPECT_NEAR(e.theta[0], 1.2e-4, 0.01 * 1.2e-4);
    EXPECT_EQ(driveid_estimator_saturations(turns.get()), 0u);
    EXPECT_GT(driveid_estimator_saturations(small.get()), 100u);
}

TEST(Fixed, RefusesWhatRoundingRulesOut) {
    driveid_regression r = plants::axis_regression();
    driveid_estimator_options o{};
    o.dt_s = 1e-3;
    char reason[300];
    std::vector<unsigned char> memory(driveid_estimator_size("fsm", DRIVEID_Q31));
    auto *e = reinterpret_cast<driveid_estimator *>(memory.data());
    auto refused = [&](const char *method, const char *word) {
        EXPECT_EQ(driveid_estimator_configure(e, memory.size(), method, DRIVEID_Q31, &r, &o, reason, sizeof reason), DRIVEID_ERR_CONFIG);
        EXPECT_NE(std::strstr(reason, word), nullptr) << reason;
    };
    refused("fsm", "range of channel 0");
    o.range[0] = o.range[1] = 1;
    r.term[0].derivative = 4;
    refused("fsm", "third derivatives");
    r.term[0].derivative = 6;
    refused("window", "fifth derivatives");
    r.term[0].derivative = 2;
    refused("kalman", "choose");
    refused("adm", "choose");
}

TEST(Fixed, FrequencyOfOneSinusoid) {
    for (const char *method : {"fsm", "window", "discrete"}) {
        driveid_regression r;
        driveid_frequency_regression(1, 5, &r);
        driveid_estimator_options o{};
        o.dt_s = 2e-3, o.range[0] = 0.5;
        std::vector<unsigned char> memory(driveid_estimator_size(method, DRIVEID_Q31));
        auto *e = reinterpret_cast<driveid_estimator *>(memory.data());
        char reason[300] = "";
        ASSERT_EQ(driveid_estimator_configure(e, memory.size(), method, DRIVEID_Q31, &r, &o, reason, sizeof reason), DRIVEID_OK) << reason;
        for (int k = 0; k < 5000; k++) {
            const double y = 0.2 * std::sin(5 * k * 2e-3 + 1) + 0.1;
            driveid_estimator_update(e, 1 + int64_t(k) * 2000000, &y);
        }
        driveid_estimate a{};
        driveid_frequency f{};
        ASSERT_EQ(driveid_estimator_estimate(e, &a), DRIVEID_OK) << method;
        ASSERT_EQ(driveid_frequency_read(&a, &f), DRIVEID_OK);
        std::printf("%-8s omega %.6f (5), +- %.1e\n", method, f.omega_rad_s[0], (f.hi_rad_s[0] - f.lo_rad_s[0]) / 2);
        EXPECT_NEAR(f.omega_rad_s[0], 5, 1e-3);
        EXPECT_GT(f.hi_rad_s[0], f.lo_rad_s[0]);
    }
}

TEST(Fixed, FrequenciesOfTwoSinusoids) { // fifth derivatives: windows carry them, filters refuse
    driveid_regression r;
    driveid_frequency_regression(2, 14, &r);
    driveid_estimator_options o{};
    o.dt_s = 2e-3, o.range[0] = 0.5;
    for (const char *method : {"window", "discrete", "fsm"}) {
        std::vector<unsigned char> memory(driveid_estimator_size(method, DRIVEID_Q31));
        auto *e = reinterpret_cast<driveid_estimator *>(memory.data());
        char reason[300] = "";
        const driveid_status status = driveid_estimator_configure(e, memory.size(), method, DRIVEID_Q31, &r, &o, reason, sizeof reason);
        if (std::strcmp(method, "fsm") == 0) {
            EXPECT_EQ(status, DRIVEID_ERR_CONFIG);
            EXPECT_NE(std::strstr(reason, "take window"), nullptr) << reason;
            continue;
        }
        ASSERT_EQ(status, DRIVEID_OK) << reason;
        for (int k = 0; k < 8000; k++) {
            const double t = k * 2e-3, y = 0.1 + 0.2 * std::sin(5 * t + 1) + 0.15 * std::sin(14 * t + 0.3);
            driveid_estimator_update(e, 1 + int64_t(k) * 2000000, &y);
        }
        driveid_estimate a{};
        driveid_frequency f{};
        ASSERT_EQ(driveid_estimator_estimate(e, &a), DRIVEID_OK) << method;
        ASSERT_EQ(driveid_frequency_read(&a, &f), DRIVEID_OK);
        std::printf("%-8s omega %.5f (5) +- %.1e, %.5f (14) +- %.1e\n", method, f.omega_rad_s[0], (f.hi_rad_s[0] - f.lo_rad_s[0]) / 2, f.omega_rad_s[1], (f.hi_rad_s[1] - f.lo_rad_s[1]) / 2);
        EXPECT_NEAR(f.omega_rad_s[0], 5, 0.01);
        EXPECT_NEAR(f.omega_rad_s[1], 14, 0.01);
    }
}

} // namespace
