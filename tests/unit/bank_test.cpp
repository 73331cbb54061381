// SPDX-License-Identifier: Apache-2.0
// The filter bank against closed-form answers of 1/(s/lambda + 1)^N.
#include <gtest/gtest.h>

#include <cmath>

extern "C" {
#include "base/bank.h"
}

namespace {

constexpr double lambda = 40;

// Step answer of N equal sections: 1 - e^-x sum x^m/m!.
double step_answer(double t, int n) {
    double term = 1, sum = 0;
    for (int m = 0; m < n; m++) sum += term, term *= lambda * t / (m + 1);
    return 1 - std::exp(-lambda * t) * sum;
}

driveid_bank_f64 make(uint8_t hold, uint8_t level, uint8_t sections = 4) {
    driveid_bank_f64 bank;
    driveid_bank_init_f64(&bank, 1, sections, lambda, &hold, &level);
    return bank;
}

TEST(Bank, HeldAndAveragedStepsAreExactAtAnyStamps) {
    for (uint8_t hold : {DRIVEID_HOLD_ZERO, DRIVEID_HOLD_AVERAGE}) {
        auto bank = make(hold, 1);
        const double one = 1;
        driveid_bank_start_f64(&bank, &one, nullptr);
        int64_t t = 0;
        for (int k = 0; k < 200; k++) {
            const int64_t dt = 1000000 + (k * 7919 % 501) * 1000 - 250000;
            driveid_bank_step_f64(&bank, dt, &one, nullptr);
            t += dt;
            EXPECT_NEAR(driveid_bank_value_f64(&bank, 0, 0), step_answer(t * 1e-9, 4), 1e-13) << "hold " << int(hold) << " step " << k;
        }
    }
}

// A parabola between stamps is exact for a parabola; its derivatives too.
TEST(Bank, SmoothHoldIsExactForAParabola) {
    auto bank = make(DRIVEID_HOLD_FIRST, 0);
    const double h = 0.01;
    auto y = [](double t) { return 3 + 2 * t + 5 * t * t; };
    double value = y(0);
    driveid_bank_start_f64(&bank, &value, nullptr);
    for (int k = 1; k <= 400; k++) value = y(k * h), driveid_bank_step_f64(&bank, 10000000, &value, nullptr);
    // long after the start: s^2 y = 10, s y = 2 + 10 (t - N/lambda), from the moments of the bank
    const double t = 400 * h;
    EXPECT_NEAR(driveid_bank_value_f64(&bank, 0, 2), 10, 1e-8);
    EXPECT_NEAR(driveid_bank_value_f64(&bank, 0, 1), 2 + 10 * (t - 4 / lambda), 1e-8);
}

TEST(Bank, HermiteHoldIsExactForACubic) {
    driveid_bank_f64 bank = make(DRIVEID_HOLD_FIRST, 1, 3);
    auto y = [](double t) { return t * t * t; };
    double value = 0, slope = 0;
    driveid_bank_start_f64(&bank, &value, &slope);
    double v[3] = {0, 0, 0}; // the same cascade by small Runge-Kutta steps
    const double h = 0.02;
    for (int k = 1; k <= 50; k++) {
        const int steps = 200;
        for (int i = 0; i < steps; i++) {
            const double d = h / steps, t0 = (k - 1) * h + i * d;
            auto f = [&](double t, const double *x, double *out) {
                out[0] = lambda * (y(t) - x[0]);
                out[1] = lambda * (x[0] - x[1]);
                out[2] = lambda * (x[1] - x[2]);
            };
            double k1[3], k2[3], k3[3], k4[3], x[3];
            f(t0, v, k1);
            for (int j = 0; j < 3; j++) x[j] = v[j] + d / 2 * k1[j];
            f(t0 + d / 2, x, k2);
            for (int j = 0; j < 3; j++) x[j] = v[j] + d / 2 * k2[j];
            f(t0 + d / 2, x, k3);
            for (int j = 0; j < 3; j++) x[j] = v[j] + d * k3[j];
            f(t0 + d, x, k4);
            for (int j = 0; j < 3; j++) v[j] += d / 6 * (k1[j] + 2 * k2[j] + 2 * k3[j] + k4[j]);
        }
        value = y(k * h), slope = 3 * k * h * k * h;
        driveid_bank_step_f64(&bank, 20000000, &value, &slope);
        EXPECT_NEAR(driveid_bank_value_f64(&bank, 0, 0), v[2], 1e-10);
        EXPECT_NEAR(driveid_bank_value_f64(&bank, 0, 1), lambda * (v[1] - v[2]), 1e-8);
        EXPECT_NEAR(driveid_bank_value_f64(&bank, 0, 3), lambda * lambda * lambda * (y(k * h) - 3 * v[0] + 3 * v[1] - v[2]), 1e-4);
    }
}

// s^i/D on an impulse: lambda^N t^(N-1)/(N-1)! e^-lambda t for i = 0, scaled by 1/lambda.
TEST(Bank, ImpulseIsTheAnswerToInitialConditions) {
    auto bank = make(DRIVEID_HOLD_FIRST, 1);
    const double zero = 0;
    driveid_bank_start_f64(&bank, &zero, nullptr);
    EXPECT_EQ(driveid_bank_impulse_f64(&bank, 3), 1);
    for (int k = 1; k <= 100; k++) {
        driveid_bank_step_f64(&bank, 2000000, &zero, nullptr);
        const double x = lambda * k * 2e-3;
        EXPECT_NEAR(driveid_bank_impulse_f64(&bank, 0), x * x * x / 6 * std::exp(-x), 1e-13);
    }
    for (int k = 0; k < 2000; k++) driveid_bank_step_f64(&bank, 2000000, &zero, nullptr);
    EXPECT_EQ(bank.impulse_live, 0);
}

// 1e5 rad away from zero costs f32 no digit of speed: states are relative to the input.
TEST(Bank, FloatKeepsSpeedFarFromZero) {
    const uint8_t hold = DRIVEID_HOLD_FIRST, level = 0;
    driveid_bank_f32 bank;
    driveid_bank_init_f32(&bank, 1, 4, lambda, &hold, &level);
    double angle = 1e5;
    driveid_bank_start_f32(&bank, &angle, nullptr);
    for (int k = 0; k < 3000; k++) angle += 0.05, driveid_bank_step_f32(&bank, 1000000, &angle, nullptr);
    EXPECT_NEAR(driveid_bank_value_f32(&bank, 0, 1), 50, 50 * 1e-5); // rounding of a step, 6e-8, over lambda h = 0.04, a few times
}

TEST(Bank, JitterCostsNoAccuracy) {
    auto jittered = make(DRIVEID_HOLD_FIRST, 0), even = make(DRIVEID_HOLD_FIRST, 0);
    auto y = [](double t) { return std::sin(7 * t) + 0.5 * t; };
    double value = 0;
    driveid_bank_start_f64(&jittered, &value, nullptr);
    driveid_bank_start_f64(&even, &value, nullptr);
    int64_t t = 0;
    for (int k = 1; k <= 2000; k++) {
        const int64_t next = k * INT64_C(1000000) + (k % 2000 ? (k * 7907 % 601 - 300) * 100 : 0);
        value = y(next * 1e-9);
        driveid_bank_step_f64(&jittered, next - t, &value, nullptr);
        t = next;
        value = y(k * 1e-3);
        driveid_bank_step_f64(&even, 1000000, &value, nullptr);
    }
    for (unsigned i = 0; i < 3; i++) // h^3 omega^3 / 30 of the parabola
        EXPECT_NEAR(driveid_bank_value_f64(&jittered, 0, i), driveid_bank_value_f64(&even, 0, i), 2e-8 * std::pow(lambda, i));
}

} // namespace
