// SPDX-License-Identifier: Apache-2.0
// Kasac, Majetic, Brezak 2018, Example 1 with the algebraic derivative beside frequency shifting: Table 1's other half, growth, and what is left of both after long. The paper's
// own form of the derivative estimator (66), (67), (69) is written here; beside it runs the library's "adm", which sums squares where the paper sums magnitudes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <driveid/frequency.h>
#include <driveid/fsm.h>

#include "page.hpp"

namespace {

double uniform(std::mt19937_64 &g, double half) { return std::uniform_real_distribution<double>(-half, half)(g); }
double signal(double t) { return 0.2 * std::sin(5 * t + 1) + 0.1; }
double noise_of(double snr_db) { return std::sqrt(3 * (0.1 * 0.1 + 0.2 * 0.2 / 2) / std::pow(10, snr_db / 10)); } // half width of a uniform one

// (66) with z3' = -6 y (printed +6 y) and (67) in small steps between the samples, y held or a straight line there; (69) from the samples.
struct Derivative {
    double h;
    bool line = false;
    double z[7] = {}, filter[2][2] = {}, above = 0, below = 0, last = 0;
    long count = 0;
    void step(double y) {
        constexpr int parts = 8;
        for (int i = 0; i < parts && count > 0; i++) {
            const double d = h / parts, t = ((count - 1) + (i + 0.5) / parts) * h, x = line ? last + (i + 0.5) / parts * (y - last) : last;
            const double rate[7] = {0, z[2] - 9 * t * t * x, z[3] + 18 * t * x, -6 * x, z[5], z[6] - t * t * t * x, 3 * t * t * x};
            const double in[2] = {z[1] + d / 2 * rate[1] + t * t * t * x, z[4] + d / 2 * rate[4]};
            for (int j = 3; j > 0; j--) z[j] += d * rate[j] + (j < 3 ? d * d / 2 * rate[j + 1] : 0), z[j + 3] += d * rate[j + 3] + (j < 3 ? d * d / 2 * rate[j + 4] : 0);
            for (int c = 0; c < 2; c++) {
                filter[c][1] += d * (-2 * 0.707 * 15 * filter[c][1] - 225 * (filter[c][0] - in[c]));
                filter[c][0] += d * filter[c][1];
            }
        }
        above += std::fabs(filter[0][0]), below += std::fabs(filter[1][0]);
        last = y, count++;
    }
    double k() const { return above / below; }
};

// Mean absolute error of k over [1, 10] s, %.
double derivative_error(double h, double snr_db, bool line, int runs) {
    double total = 0;
    for (int run = 0; run < runs; run++) {
        std::mt19937_64 g(run + 1);
        Derivative e{h, line};
        double sum = 0;
        int count = 0;
        for (int i = 0; i * h <= 10 + 1e-9; i++) {
            e.step(signal(i * h) + uniform(g, noise_of(snr_db)));
            if (i * h >= 1) sum += std::fabs(e.k() / 25 - 1), count++;
        }
        total += 100 * sum / count;
    }
    return total / runs;
}

// The library's estimators on the same signal; error averaged over the samples with an answer.
double library_error(const char *method, double h, double snr_db, int runs, double from_s, double to_s) {
    driveid_regression r;
    driveid_frequency_regression(1, 5, &r);
    driveid_estimator_options o{};
    o.dt_s = h, o.alarm = -1, o.forgetting_s = INFINITY;
    std::vector<unsigned char> memory(driveid_estimator_size(method, DRIVEID_F64));
    auto *e = reinterpret_cast<driveid_estimator *>(memory.data());
    double total = 0;
    for (int run = 0; run < runs; run++) {
        std::mt19937_64 g(run + 1);
        EXPECT_EQ(driveid_estimator_configure(e, memory.size(), method, DRIVEID_F64, &r, &o, nullptr, 0), DRIVEID_OK);
        double sum = 0;
        int count = 0;
        driveid_estimate a{};
        for (int i = 0; i * h <= to_s + 1e-9; i++) {
            const double y = signal(i * h) + uniform(g, noise_of(snr_db));
            driveid_estimator_update(e, 1 + llround(1e9 * h * i), &y);
            if (i * h < from_s || i % 5 || driveid_estimator_estimate(e, &a) < 0 || a.params == 0) continue;
            sum += std::fabs(a.theta[0] / 25 - 1), count++;
        }
        if (count) total += 100 * sum / count;
        else total += 100;
    }
    return total / runs;
}

driveid_fsm_config shifting() { return {3, DRIVEID_FSM_AUTONOMOUS, 0b101, 5, DRIVEID_HOLD_FIRST, 0, {5, 6, 7, 8, 9}, 0.5}; }

} // namespace

// Reachable: 23.62 dB with straight lines between the samples (NOTES: held 0.537, 0.920, 1.401, 2.185), 3.48 dB, where noise is all, as held. The paper does not say how its low-pass (67)
// was discretised; that and 100 runs make an eighth.
TEST(KasacExample1, Table1AlgebraicDerivative) {
    struct Cell { double h, snr, printed, reachable; };
    const page::Table table("Kasac 2018", "Table 1, algebraic derivative: mean absolute error of k = 25, %, averaged over [1, 10] s", "(66), (67) and (69) between samples on straight lines; 100 runs");
    for (Cell c : {Cell{0.002, 23.62, 0.547, 0.495}, {0.002, 3.48, 6.306, 6.53}, {0.005, 23.62, 0.906, 0.784}, {0.005, 3.48, 10.85, 11.69}, {0.01, 23.62, 1.499, 1.105}, {0.01, 3.48, 17.16, 17.20},
                   {0.02, 23.62, 2.493, 1.564}, {0.02, 3.48, 24.39, 23.93}})
        table.near(page::join("ADM, h %g s, %g dB", c.h, c.snr), c.printed, derivative_error(c.h, c.snr, true, 100), c.reachable, 0.125 * c.reachable);
}

TEST(KasacExample1, WhichConvergesFaster) { // noise-free at 1 s; z3' = +6 y as printed would give 21.2 at 2 s
    driveid_fsm_f64 f;
    const driveid_fsm_config c = shifting();
    ASSERT_EQ(driveid_fsm_configure_f64(&f, &c, nullptr, 0), DRIVEID_OK);
    Derivative d{0.002, true};
    double above = 0, below = 0;
    for (int i = 0; i <= 500; i++) {
        d.step(signal(i * 0.002));
        driveid_fsm_update_f64(&f, i * INT64_C(2000000), signal(i * 0.002), 0);
        above += std::fabs(f.row[0][1]), below += std::fabs(f.row[0][0]);
    }
    // straight lines reach 2.5e-3 and 1.7e-4 (NOTES); three times that. The paper's solver leaves 1.71 and 0.65 (held inputs).
    const page::Table table("Kasac 2018", "Example 1: error at 1 s without noise, % (a figure in the paper: frequency shifting \"faster\")", "straight lines; what the paper's figure shows is its solver's hold, 1.71 and 0.65 here");
    table.below("algebraic derivative", page::none, 100 * std::fabs(d.k() / 25 - 1), 0.0075);
    table.below("frequency shifting", page::none, 100 * std::fabs(above / below / 25 - 1), 0.00052);
}

TEST(KasacExample1, BoundedAndUnbounded) { // 1000 s
    const double h = 0.002;
    driveid_fsm_f64 f;
    const driveid_fsm_config c = shifting();
    ASSERT_EQ(driveid_fsm_configure_f64(&f, &c, nullptr, 0), DRIVEID_OK);
    Derivative d{h}, noisy{h};
    std::mt19937_64 g(1);
    double most[2] = {0, 0} /* times the product of the poles: sections have unit gain */, above = 0, below = 0;
    std::vector<double> k_shift, k_derivative;
    for (int i = 0; i <= 500000; i++) {
        const double y = signal(i * h), n = uniform(g, 0.02);
        d.step(y), noisy.step(y + n);
        driveid_fsm_update_f64(&f, llround(i * h * 1e9), y + n, 0);
        above += std::fabs(f.row[0][1]), below += std::fabs(f.row[0][0]);
        for (int j = 0; j < 2; j++) most[j] = std::max(most[j], std::fabs(f.row[0][j]));
        if (i == 5000 || i == 25000 || i == 500000) k_shift.push_back(above / below), k_derivative.push_back(noisy.k());
    }
    const page::Table table("Kasac 2018", "Example 1: after 1000 s (figures in the paper)", "noise of +-0.02 m for the k; NOTES: 5.4e-4, 2.2e-5, growth as t^3");
    table.below("frequency shifting: largest |Y_03|", page::none, most[1] / 15120, 5.6e-4);
    table.below("frequency shifting: largest |Y_01|", page::none, most[0] / 15120, 2.3e-5);
    table.near("algebraic derivative: log10 |z_1|", page::none, std::log10(std::fabs(d.z[1])), 8, 0.7);
    const double reached[3] = {24.98, 24.99, 25.001}, seconds[3] = {10, 50, 1000};
    for (int i = 0; i < 3; i++) table.near(page::join("k by frequency shifting, %g s", seconds[i]), page::none, k_shift[i], reached[i], 0.05);
    const double lost[3] = {24.8, 20, 0.30}, slack[3] = {1, 6, 1.3}; // one run each: seven seeds lie in 24.6 .. 25.5, 19 .. 24.4 and 0.2 .. 1.6; NOTES' in 24.8, 15.6, 0.30
    for (int i = 0; i < 3; i++) table.near(page::join("k by the algebraic derivative, %g s", seconds[i]), page::none, k_derivative[i], lost[i], slack[i]);
    EXPECT_GT(library_error("adm", 0.01, 15, 1, 200, 210), 20); // the library's, after 200 s: worth nothing either
    EXPECT_LT(library_error("fsm", 0.01, 15, 1, 200, 210), 1);
}
