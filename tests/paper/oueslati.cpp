// SPDX-License-Identifier: Apache-2.0
// Oueslati et al. 2011: the best sinusoid, and the sliding window on the mass-spring-damper (k 400 N/m, c 0.05 Ns/m, m 3 kg, 1 kHz).
// Asserted is what a correct implementation reaches; the printed value stands beside it.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

#include <driveid/estimate.h>
#include <driveid/excitation.h>

#include "page.hpp"

namespace {

const double w0 = std::sqrt(400.0 / 3), zeta = 0.05 / (2 * std::sqrt(400.0 * 3)), push = 333.3333 / 3;

// x of the damped oscillator from rest under push sin(Z w0 t), closed form.
double position(double Z, double t) {
    const double w = Z * w0, d = zeta * w0, wd = w0 * std::sqrt(1 - zeta * zeta);
    const double re = w0 * w0 - w * w, im = 2 * d * w, n = re * re + im * im;
    const double a = push * re / n, b = -push * im / n; // a sin + b cos
    const double c = -b, s = (-a * w + d * c) / wd;
    return a * std::sin(w * t) + b * std::cos(w * t) + std::exp(-d * t) * (c * std::cos(wd * t) + s * std::sin(wd * t));
}

double best_ratio(int samples, double *loss_at_one) {
    const driveid_excitation e{w0, 0, 1, 1, 1e-3, samples * 1e-3};
    double least = INFINITY, at = 0, one = 0, v = 0;
    for (double z = 0.05; z < 4; z += 0.01)
        if (driveid_excitation_variance(&e, z, 1, &v) == DRIVEID_OK && v < least) least = v, at = z;
    driveid_excitation_variance(&e, 1, 1, &one);
    *loss_at_one = one / least;
    return at;
}

TEST(Oueslati, OptimalRatioOfTheVariance) {
    double loss;
    const page::Table table("Oueslati 2011", "Best frequency ratio Z of the variance (13)", "(12) has one omega_0 too many: without it Z = 1 holds beyond some four periods only");
    struct Row { int k; double reachable, slack; };
    for (Row r : {Row{100, 3.1, 0.1}, {300, 0.94, 0.03}, {500, 1.20, 0.03}, {1000, 0.88, 0.03}, {2000, 0.995, 0.02}}) {
        const double z = best_ratio(r.k, &loss);
        table.near(page::join("%.0f samples", r.k), 1, z, r.reachable, r.slack);
        if (r.k == 100) table.near("K(1) / K(best), 100 samples", 1, loss, 3.9, 0.2);
    }
}

TEST(Oueslati, ForgettingOnlyCosts) {
    const driveid_excitation e{w0, 0, 1, 1, 1e-3, 0.1};
    double all, some;
    const page::Table table("Oueslati 2011", "Variance with forgetting over that without", "");
    driveid_excitation_variance(&e, 1, 1, &all);
    for (auto [lambda, low, high] : {std::array{0.95, 1.15, 1.25}, {0.98, 1.02, 1.07}, {0.99, 1.0, 1.03}}) {
        driveid_excitation_variance(&e, 1, lambda, &some);
        table.near(page::join("K(%g) / K(1)", lambda), page::none, some / all, (low + high) / 2, (high - low) / 2);
    }
}

TEST(Oueslati, TheBoundIsThatOfTheMotionsOwnSensitivities) {
    const driveid_excitation e{w0, zeta, push, 1e-2, 1e-3, 1.0};
    for (double z : {0.5, 1.0, 2.0}) {
        double bound_w, bound_z;
        ASSERT_EQ(driveid_excitation_bound(&e, z, &bound_w, &bound_z), DRIVEID_OK);
        // sensitivity by differences of a fine Runge-Kutta motion that shares no code with the library
        auto motion = [&](double w, double damp, std::vector<double> &x) {
            double p = 0, v = 0;
            x.clear();
            for (int k = 0; k < 1000; k++) {
                for (int i = 0; i < 10; i++) {
                    const double h = 1e-4, t = k * 1e-3 + i * h;
                    auto acc = [&](double tt, double pp, double vv) { return push * std::sin(z * w0 * tt) - 2 * damp * w * vv - w * w * pp; };
                    const double a1 = acc(t, p, v), a2 = acc(t + h / 2, p + h / 2 * v, v + h / 2 * a1), pm = p + h * v + h * h / 2 * a2, vm = v + h * a2;
                    p += h * v + h * h / 6 * (a1 + 2 * a2), v += h / 6 * (a1 + 4 * a2 + acc(t + h, pm, vm));
                }
                x.push_back(p);
            }
        };
        std::vector<double> base, by_w, by_z;
        motion(w0, zeta, base), motion(w0 * (1 + 1e-5), zeta, by_w), motion(w0, zeta + 1e-5, by_z);
        double ww = 0, wz = 0, zz = 0;
        for (int k = 0; k < 1000; k++) {
            const double a = (by_w[k] - base[k]) / 1e-5, b = (by_z[k] - base[k]) / 1e-5;
            ww += a * a, wz += a * b, zz += b * b;
        }
        EXPECT_NEAR(bound_w, 1e-2 / std::sqrt(ww - wz * wz / zz), 0.01 * bound_w);
    }
    double ratio, bound;
    ASSERT_EQ(driveid_excitation_suggest(&e, &ratio, &bound), DRIVEID_OK);
    double at_one, other;
    driveid_excitation_bound(&e, 1, &at_one, &other);
    std::printf("suggested Z = %.2f: std of w0 %.2e, at Z = 1 %.2e\n", ratio, bound, at_one);
    EXPECT_LE(bound, at_one * 1.0001);
    driveid_excitation bad = e;
    bad.dt_s = 0;
    EXPECT_EQ(driveid_excitation_suggest(&bad, &ratio, &bound), DRIVEID_ERR_ARGUMENT);
}

struct Settled { double error_w0, reached_s; };

// A second order equation x'' + theta_1 x' + theta_2 x = u with the library's window; noise by SNR of x.
Settled window(double Z, double snr_db, double span, uint64_t seed, double bandwidth, int from = 0) {
    driveid_regression r{};
    r.equations = 1, r.channels = 2, r.params = 2, r.terms = 4, r.may_be_zero = 1;
    r.term[0] = {0, 0, 2, DRIVEID_TERM_KNOWN, 1};
    r.term[1] = {0, 0, 1, 0, 1};
    r.term[2] = {0, 0, 0, 1, 1};
    r.term[3] = {0, 1, 0, DRIVEID_TERM_KNOWN, -1};
    driveid_estimator_options o{};
    o.dt_s = 1e-3, o.bandwidth_rad_s = bandwidth, o.forgetting_s = INFINITY, o.alarm = -1;
    std::vector<unsigned char> memory(driveid_estimator_size("window", DRIVEID_F64));
    auto *e = reinterpret_cast<driveid_estimator *>(memory.data());
    EXPECT_EQ(driveid_estimator_configure(e, memory.size(), "window", DRIVEID_F64, &r, &o, nullptr, 0), DRIVEID_OK);
    double power = 0;
    for (int k = 0; k < 5000; k++) power += std::pow(position(Z, k * 1e-3), 2) / 5000;
    std::mt19937_64 g(seed);
    std::normal_distribution<double> noise(0, std::sqrt(power / std::pow(10, snr_db / 10)));
    Settled s{1, 0};
    for (int k = 0; k * 1e-3 <= span; k++) {
        const double t = k * 1e-3, at = t + from * 1e-3, channel[2] = {position(Z, at) + (snr_db < 300 ? noise(g) : 0), push * std::sin(Z * w0 * at)};
        driveid_estimator_update(e, 1 + int64_t(k) * 1000000, channel);
        driveid_estimate a{};
        const driveid_status status = driveid_estimator_estimate(e, &a);
        const double error = status == DRIVEID_OK || status == DRIVEID_WEAK_EXCITATION ? std::fabs(std::sqrt(std::fabs(a.theta[1])) / w0 - 1) : 1;
        if (error > 0.02) s.reached_s = t;
        s.error_w0 = error;
    }
    return s;
}

TEST(Oueslati, SlidingWindowAccumulated) {
    const Settled clean = window(1, 1000, 2, 1, 100);
    const page::Table table("Oueslati 2011", "Sliding window: worst error of omega_0 after 5 s, %; seconds to 2 % for good (10 seeds)",
                            "the bound at 5 ms is thousands of percent; the default window is chosen for the error, not for the start");
    table.below("noise-free, error", page::none, 100 * clean.error_w0, 1e-4);
    struct Row { double snr, Z, error, reached, printed, printed_s; };
    for (Row r : {Row{25, 1, 0.5, 1.5, .0035, page::none}, {25, 10, 0.5, 1.5, .0035, page::none}, {50, 1, 0.05, 1.3, page::none, page::none}, {80, 10, 0.05, 1.3, page::none, 0.005}}) {
        double worst = 0, latest = 0;
        for (uint64_t seed = 1; seed <= 10; seed++) {
            const Settled s = window(r.Z, r.snr, 5, seed, 100);
            worst = std::max(worst, s.error_w0), latest = std::max(latest, s.reached_s);
        }
        table.below(page::join("%g dB, Z = %g: error", r.snr, r.Z), r.printed, 100 * worst, r.error);
        table.below(page::join("%g dB, Z = %g: seconds", r.snr, r.Z), r.printed_s, latest, r.reached);
    }
}

TEST(Oueslati, ShortSlidingWindow) { // begun anywhere in the motion's first four seconds, as a window that slides
    const page::Table table("Oueslati 2011", "Short sliding windows (bandwidth 400 rad/s): seconds to 2 % of omega_0 for good, 38 of 40 runs",
                            "one window alone has 95 % of its answers within 2 % from 0.45, 0.16 and 0.056 s at 25, 50 and 80 dB (0.32 s at 25 dB, Z = 10); the library joins twelve windows and more before it answers");
    struct Row { double snr, Z, reached; };
    for (Row r : {Row{25, 1, 1.4}, {25, 10, .9}, {50, 1, .45}, {50, 10, .35}, {80, 1, .35}, {80, 10, .35}}) {
        std::vector<double> reached, at_one_s;
        for (uint64_t seed = 1; seed <= 40; seed++) {
            const int from = int(seed) * 997 % 4000;
            reached.push_back(window(r.Z, r.snr, 2, seed, 400, from).reached_s);
            if (r.snr == 25) at_one_s.push_back(window(r.Z, r.snr, 1, seed, 400, from).error_w0);
        }
        std::sort(reached.begin(), reached.end()), std::sort(at_one_s.begin(), at_one_s.end());
        table.below(page::join("%g dB, Z = %g", r.snr, r.Z), r.snr == 80 ? .005 : page::none, reached[37], r.reached);
        if (at_one_s.empty()) continue;
        const page::Table singular("Oueslati 2011", "No singular window: median error of omega_0 after 1 s (1.84 periods) at 25 dB, %", "two rows over one window of that length are nearly singular: 15 to 36 %");
        singular.below(page::join("Z = %g", r.Z), page::none, 100 * at_one_s[20], 1);
    }
}

TEST(Oueslati, FiveMillisecondsAreTooFew) { // NOTES: 7e4 % with both parameters unknown
    double power = 0, omega, damping;
    for (int k = 0; k < 5000; k++) power += std::pow(position(10, k * 1e-3), 2) / 5000;
    const driveid_excitation e{w0, zeta, push, std::sqrt(power * 1e-8), 1e-3, 5e-3};
    ASSERT_EQ(driveid_excitation_bound(&e, 10, &omega, &damping), DRIVEID_OK);
    const page::Table table("Oueslati 2011", "Cramer-Rao bound of omega_0 after 5 ms, 80 dB, Z = 10, %", "the paper's 2 % are impossible for an unbiased estimator");
    table.near("both parameters unknown", 2, 100 * omega, 7e4, 5e3);
}

// The same equation on any motion, sampled at 1 kHz; returns the instants (s) at which the estimate of omega_0 is further than 2 % from w(t).
template <class X, class W>
std::vector<double> outside(X x, W w, double Z, double span, double bandwidth, double forgetting, int *restarts = nullptr) {
    driveid_regression r{};
    r.equations = 1, r.channels = 2, r.params = 2, r.terms = 4, r.may_be_zero = 1;
    r.term[0] = {0, 0, 2, DRIVEID_TERM_KNOWN, 1}, r.term[1] = {0, 0, 1, 0, 1}, r.term[2] = {0, 0, 0, 1, 1}, r.term[3] = {0, 1, 0, DRIVEID_TERM_KNOWN, -1};
    driveid_estimator_options o{};
    o.dt_s = 1e-3, o.bandwidth_rad_s = bandwidth, o.forgetting_s = forgetting;
    std::vector<unsigned char> memory(driveid_estimator_size("window", DRIVEID_F64));
    auto *e = reinterpret_cast<driveid_estimator *>(memory.data());
    EXPECT_EQ(driveid_estimator_configure(e, memory.size(), "window", DRIVEID_F64, &r, &o, nullptr, 0), DRIVEID_OK);
    std::vector<double> out;
    driveid_estimate a{};
    for (int k = 0; k * 1e-3 <= span; k++) {
        const double t = k * 1e-3, channel[2] = {x(k), push * std::sin(Z * w0 * t)};
        driveid_estimator_update(e, 1 + int64_t(k) * 1000000, channel);
        const driveid_status status = driveid_estimator_estimate(e, &a);
        const bool have = status == DRIVEID_OK || status == DRIVEID_WEAK_EXCITATION || status == DRIVEID_FROZEN;
        if (!have || std::fabs(std::sqrt(std::fabs(a.theta[1])) / w(t) - 1) > 0.02) out.push_back(t);
    }
    if (restarts) *restarts = int(a.restarts);
    return out;
}

TEST(Oueslati, HighFrequencyPerturbation) { // 0.1 sin(500 omega_0 t), 918.9 Hz, is seen at 81.1 Hz; noise of 0.001
    std::mt19937_64 g(1);
    std::normal_distribution<double> noise(0, 0.001);
    std::vector<double> x;
    for (int k = 0; k <= 5000; k++) x.push_back(position(10, k * 1e-3) + 0.1 * std::sin(500 * w0 * k * 1e-3) + noise(g));
    const auto late = outside([&](int k) { return x[size_t(k)]; }, [](double) { return w0; }, 10, 5, 100, INFINITY);
    const page::Table table("Oueslati 2011", "High-frequency perturbation, Z = 10: seconds to 2 % of omega_0 for good", "the perturbation is four times the motion; within 5 ms every method's error is thousands of percent");
    table.below("sliding window", 0.005, late.empty() ? 0 : late.back(), 3.0);
    EXPECT_GT(late.size(), 30u); // nothing is known after 5 samples
}

TEST(Oueslati, JumpsAreTracked) { // figure 16: omega_0 jumps; here +20 % at 3 s and back at 6 s
    const auto w = [](double t) { return t >= 3 && t < 6 ? 1.2 * w0 : w0; };
    std::vector<double> x;
    double p = 0, v = 0;
    std::mt19937_64 g(1);
    std::normal_distribution<double> noise(0, 2e-5); // about 80 dB
    for (int k = 0; k <= 9000; k++) {
        x.push_back(p + noise(g));
        for (int i = 0; i < 10; i++) { // Runge-Kutta, tenths of a millisecond
            const double h = 1e-4, t = k * 1e-3 + i * h, now = w(t + h / 2);
            auto acc = [&](double tt, double pp, double vv) { return push * std::sin(w0 * tt) - 0.05 / 3 * vv - now * now * pp; };
            const double a1 = acc(t, p, v), a2 = acc(t + h / 2, p + h / 2 * v, v + h / 2 * a1), a3 = acc(t + h / 2, p + h / 2 * v + h * h / 4 * a1, v + h / 2 * a2),
                         a4 = acc(t + h, p + h * v + h * h / 2 * a2, v + h * a3);
            p += h * v + h * h / 6 * (a1 + a2 + a3), v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
        }
    }
    int restarts = 0;
    const auto late = outside([&](int k) { return x[size_t(k)]; }, w, 1, 9, 100, 0, &restarts);
    double first = 0, back = 0;
    for (double t : late) (t < 6 ? first : back) = t;
    const page::Table table("Oueslati 2011", "Jumps of omega_0 (figure 16), Z = 1: seconds until within 2 % again", "the window must be past the jump; the default one is chosen for the error");
    table.below("+20 %", page::none, first - 3, 2);
    table.below("back", page::none, back - 6, 2);
    EXPECT_EQ(restarts, 2);
}

} // namespace
