// SPDX-License-Identifier: Apache-2.0
// Algebraic frequency estimation of one and two biased sinusoids: Kasac's Example 1 (omega 5 rad/s, both noise levels of Table 1) and two modes,
// against the Cramer-Rao bound of sinusoids in white noise. The bound counts the whole record; a method with windows pays for their ends.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <driveid/frequency.h>

#include "page.hpp"

namespace {

using Rng = std::mt19937_64;

struct Signal {
    double bias, amplitude[2], omega[2], phase[2];
    int count;
    double operator()(double t) const {
        double y = bias;
        for (int i = 0; i < count; i++) y += amplitude[i] * std::sin(omega[i] * t + phase[i]);
        return y;
    }
};

struct Result {
    double rms[2] = {}, inside[2] = {};
    int answered = 0;
};

Result estimate(const char *method, driveid_real type, const Signal &signal, double dt, double span, double sigma, int seeds) {
    Result result;
    for (int seed = 1; seed <= seeds; seed++) {
        Rng g(seed);
        std::normal_distribution<double> noise(0, sigma > 0 ? sigma : 1);
        driveid_regression r;
        EXPECT_EQ(driveid_frequency_regression(signal.count, signal.omega[signal.count - 1], &r), DRIVEID_OK);
        driveid_estimator_options o{};
        o.dt_s = dt, o.forgetting_s = INFINITY, o.alarm = -1, o.range[0] = 0.8;
        std::vector<unsigned char> memory(driveid_estimator_size(method, type));
        auto *e = reinterpret_cast<driveid_estimator *>(memory.data());
        char reason[300] = "";
        EXPECT_EQ(driveid_estimator_configure(e, memory.size(), method, type, &r, &o, reason, sizeof reason), DRIVEID_OK) << reason;
        for (int k = 0; k * dt <= span; k++) {
            const double y = signal(k * dt) + (sigma > 0 ? noise(g) : 0);
            driveid_estimator_update(e, 1 + llround(k * dt * 1e9), &y);
        }
        driveid_estimate a{};
        driveid_frequency f{};
        const driveid_status status = driveid_estimator_estimate(e, &a);
        if ((status != DRIVEID_OK && status != DRIVEID_FROZEN) || driveid_frequency_read(&a, &f) != DRIVEID_OK) continue;
        result.answered++;
        for (int i = 0; i < signal.count; i++) {
            result.rms[i] += std::pow(f.omega_rad_s[i] - signal.omega[i], 2);
            result.inside[i] += f.lo_rad_s[i] <= signal.omega[i] && signal.omega[i] <= f.hi_rad_s[i];
        }
    }
    for (int i = 0; i < 2; i++) result.rms[i] = std::sqrt(result.rms[i] / result.answered), result.inside[i] /= result.answered;
    return result;
}

double bound(double amplitude, double sigma, double dt, double span) { return std::sqrt(24 * dt / span) * sigma / (amplitude * span); }

const Signal one{0.1, {0.2}, {5}, {1}, 1}, two{0.1, {0.2, 0.15}, {5, 14}, {1, 0.3}, 2};

TEST(Frequency, CleanSignals) {
    for (const char *method : {"window", "fsm"}) {
        const Result a = estimate(method, DRIVEID_F64, one, 2e-3, 5, 0, 1);
        EXPECT_EQ(a.answered, 1);
        EXPECT_LT(a.rms[0], 1e-4) << method;
        const Result b = estimate(method, DRIVEID_F64, two, 2e-3, 6, 0, 1);
        EXPECT_EQ(b.answered, 1);
        EXPECT_LT(b.rms[0], 2e-3) << method;
        EXPECT_LT(b.rms[1], 2e-3) << method;
    }
}

TEST(Frequency, OneSinusoidInNoise) {
    const double power = 0.1 * 0.1 + 0.2 * 0.2 / 2;
    const page::Table table("Cramer-Rao", "Frequency of one biased sinusoid (Example 1 of Kasac, 20 s): root mean square error over the bound", "recursive least squares is biased by noise in its regressors");
    for (double snr : {23.62, 3.48}) {
        const double sigma = std::sqrt(power / std::pow(10, snr / 10)), least = bound(0.2, sigma, 2e-3, 20);
        for (const char *method : {"window", "fsm", "discrete", "rls"}) {
            const Result r = estimate(method, DRIVEID_F64, one, 2e-3, 20, sigma, 30);
            table.below(page::join("%g dB, ", snr) + method, page::none, r.rms[0] / least, std::string(method) == "rls" ? 600 : 6);
            if (std::string(method) != "window") continue;
            EXPECT_EQ(r.answered, 30);
            EXPECT_GE(r.inside[0], 0.85);
        }
    }
}

TEST(Frequency, TwoSinusoidsInNoise) {
    const page::Table table("Cramer-Rao", "Frequencies of two biased sinusoids, 20 s: root mean square error over the bound", "");
    const Result r = estimate("window", DRIVEID_F64, two, 2e-3, 20, 0.01, 30);
    for (int i = 0; i < 2; i++) {
        const double least = bound(two.amplitude[i], 0.01, 2e-3, 20);
        EXPECT_GE(r.answered, 28);
        table.below(page::join("omega_%.0f, window", i + 1), page::none, r.rms[i] / least, 10);
        EXPECT_GE(r.inside[i], 0.8);
    }
}

TEST(Frequency, ReadRefusesWhatIsNoFrequency) {
    driveid_estimate e{};
    driveid_frequency f{};
    e.params = 1, e.theta[0] = -4;
    EXPECT_EQ(driveid_frequency_read(&e, &f), DRIVEID_RANK);
    e.params = 2, e.theta[0] = 4, e.theta[1] = 5;
    EXPECT_EQ(driveid_frequency_read(&e, &f), DRIVEID_RANK);
    driveid_regression r;
    EXPECT_EQ(driveid_frequency_regression(3, 1, &r), DRIVEID_ERR_ARGUMENT);
    EXPECT_EQ(driveid_frequency_regression(1, 1, nullptr), DRIVEID_ERR_ARGUMENT);
}

} // namespace
