// SPDX-License-Identifier: Apache-2.0
// Known-truth drives for tests: plain equations of motion, Runge-Kutta in small steps. Shares no code with the library.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <random>

namespace plants {

using Rng = std::mt19937_64;
inline double gauss(Rng &g) { return std::normal_distribution<double>()(g); }
inline double uniform(Rng &g, double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(g); }
inline double log_uniform(Rng &g, double lo, double hi) { return lo * std::exp(uniform(g, 0, 1) * std::log(hi / lo)); }

template <std::size_t N>
void rk4(std::array<double, N> &x, double h, int steps, const std::function<std::array<double, N>(const std::array<double, N> &)> &f) {
    const double d = h / steps;
    auto plus = [](const std::array<double, N> &a, const std::array<double, N> &b, double k) {
        std::array<double, N> r;
        for (std::size_t i = 0; i < N; i++) r[i] = a[i] + k * b[i];
        return r;
    };
    for (int s = 0; s < steps; s++) {
        const auto k1 = f(x), k2 = f(plus(x, k1, d / 2)), k3 = f(plus(x, k2, d / 2)), k4 = f(plus(x, k3, d));
        for (std::size_t i = 0; i < N; i++) x[i] += d / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]);
    }
}

// Rigid axis under a torque that is held over the step, closed form; with Coulomb friction it sticks when it can.
struct Axis {
    double J, B, tau_c = 0, tau_0 = 0, theta = 0, omega = 0;
    void step(double tau, double h) {
        if (tau_c == 0) return slide(tau - tau_0, h);
        const double net = tau - tau_0;
        if (omega == 0) {
            if (std::fabs(net) <= tau_c) return;
            omega = std::copysign(1e-12, net);
        }
        const double s = omega > 0 ? 1 : -1, w0 = omega, end = (net - s * tau_c) / B, fade = B / J;
        const double w1 = end + (w0 - end) * std::exp(-fade * h);
        if (w1 * s > 0) return slide(net - s * tau_c, h);
        const double stop = std::log((w0 - end) / -end) / fade; // comes to a stand inside the step
        slide(net - s * tau_c, stop);
        omega = 0;
        if (h - stop > 1e-12 * h) step(tau, h - stop);
    }
    void slide(double net, double h) {
        const double end = net / B, fade = B / J, e = std::exp(-fade * h);
        theta += end * h + (omega - end) * (1 - e) / fade;
        omega = end + (omega - end) * e;
    }
};

// Position loop over minimum-jerk moves of random length with rests between them; the torque that it asks for is what the record holds.
struct Program {
    Rng &g;
    double from = 0, to = 0, start = 0, length = 1, rest = 1;
    double target(double t) {
        if (t > start + length + rest) {
            from = to, to = uniform(g, -20, 20), start = t, length = uniform(g, 0.4, 1.5);
            const double u = uniform(g, 0, 1);
            rest = u < 0.7 ? uniform(g, 0.05, 1) : u < 0.97 ? uniform(g, 1, 10) : uniform(g, 60, 400);
        }
        const double x = std::fmin(1, (t - start) / length);
        return from + (to - from) * x * x * x * (10 - 15 * x + 6 * x * x);
    }
};

} // namespace plants
