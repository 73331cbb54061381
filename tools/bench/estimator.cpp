// SPDX-License-Identifier: Apache-2.0
// Nanoseconds per sample of the on-line estimator, next to a recursive least squares of as many parameters in Eigen. Prints a markdown table.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

#include <Eigen/Dense>

#include <driveid/estimate.h>

namespace {

using Clock = std::chrono::steady_clock;
constexpr int samples = 50000;

driveid_regression equation(int n) { // y^(n) + sum a_i y^(i) = b u: n + 1 parameters
    driveid_regression r{};
    r.equations = 1, r.channels = 2, r.params = uint8_t(n + 1), r.terms = uint8_t(n + 2);
    r.hold[1] = DRIVEID_HOLD_ZERO;
    r.term[0] = {0, 0, uint8_t(n), DRIVEID_TERM_KNOWN, 1};
    for (int i = 0; i < n; i++) r.term[1 + i] = {0, 0, uint8_t(i), int8_t(i), 1};
    r.term[n + 1] = {0, 1, 0, int8_t(n), -1};
    return r;
}

const std::vector<double> &signal() {
    static std::vector<double> x = [] {
        std::mt19937 g(1);
        std::normal_distribution<double> normal;
        std::vector<double> v(2 * samples);
        for (int k = 0; k < samples; k++) v[2 * k] = std::sin(0.011 * k) + 0.5 * std::sin(0.037 * k) + 1e-3 * normal(g), v[2 * k + 1] = std::cos(0.011 * k);
        return v;
    }();
    return x;
}

// Best of five: the machine may be busy with other things.
template <class F> double best_ns(F f) {
    double best = 1e18;
    for (int i = 0; i < 5; i++) {
        const auto t = Clock::now();
        f();
        best = std::min(best, std::chrono::duration<double, std::nano>(Clock::now() - t).count() / samples);
    }
    return best;
}

double estimator_ns(int n, driveid_real type, bool solve) {
    std::vector<unsigned char> memory(driveid_estimator_size("fsm", type));
    auto *e = reinterpret_cast<driveid_estimator *>(memory.data());
    const driveid_regression r = equation(n);
    driveid_estimator_options o{};
    o.dt_s = 1e-3, o.alarm = -1, o.answer_s = solve ? 0 : 1e6;
    return best_ns([&] {
        if (driveid_estimator_configure(e, memory.size(), "fsm", type, &r, &o, nullptr, 0)) std::abort();
        for (int k = 0; k < samples; k++) driveid_estimator_update(e, INT64_C(1000000) * k, &signal()[2 * k]);
    });
}

double rls_ns(int n) { // textbook: P and theta each sample; the derivatives that it would need come for free here
    const int p = n + 1;
    double sink = 0;
    const double ns = best_ns([&] {
        Eigen::MatrixXd P = Eigen::MatrixXd::Identity(p, p) * 1e3;
        Eigen::VectorXd theta = Eigen::VectorXd::Zero(p), phi(p), g(p);
        for (int k = p; k < samples; k++) {
            for (int i = 0; i < p; i++) phi[i] = signal()[2 * (k - i)];
            g.noalias() = P * phi;
            const double gain = 1 / (0.9999 + phi.dot(g));
            theta += g * (gain * (signal()[2 * k + 1] - phi.dot(theta)));
            P.noalias() -= gain * g * g.transpose();
            P /= 0.9999;
        }
        sink += theta[0];
    });
    if (!std::isfinite(sink)) std::printf("\n");
    return ns;
}

} // namespace

int main() {
    std::printf("Realisation: economical (bank of n + 2 sections at every sample, 5 prefilters and sums at every 2.5 ms, solve every 20 ms), 1 kHz.\n");
    std::printf("Compiler %s, flags %s\n\n", __VERSION__, DRIVEID_BENCH_FLAGS);
    std::printf("| n | parameters | type | update, ns | with solve, ns | Eigen RLS, ns | update / RLS | with solve / RLS | drives per core at 1 kHz |\n|---|---|---|---|---|---|---|---|---|\n");
    for (int n : {1, 2, 4}) {
        const double rls = rls_ns(n);
        for (driveid_real type : {DRIVEID_F64, DRIVEID_F32}) {
            const double plain = estimator_ns(n, type, false), solved = estimator_ns(n, type, true);
            std::printf("| %d | %d | %s | %.0f | %.0f | %.0f | %.2f | %.2f | %.0f |\n", n, n + 1, type == DRIVEID_F64 ? "f64" : "f32", plain, solved, rls, plain / rls, solved / rls, 1e6 / solved);
            std::fflush(stdout);
        }
    }
}
