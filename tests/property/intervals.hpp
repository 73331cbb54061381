// SPDX-License-Identifier: Apache-2.0
// Coverage of the stated 95 % intervals against known truth, cell by cell; and the Cramer-Rao bound where the noise is white.
#pragma once
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "axis.hpp"
#include "plants.hpp"
#include <driveid/estimate.h>

namespace intervals {

using plants::Rng;
constexpr double dt = 1e-3, span_s = 6;

enum Cell { white, coloured, rests, quantised, closed_loop, late_stamps, cells };
inline const char *name(Cell c) {
    static const char *const names[] = {"white noise", "coloured noise", "rests", "quantised encoder", "closed loop", "late stamps"};
    return names[c];
}

struct Result {
    int runs = 0, answered = 0, covered[2] = {0, 0};
    std::vector<double> width[2], ratio[2]; // half-width / 1.96 over truth; over the Cramer-Rao bound
};

// Minimum-jerk moves with a rest after each.
struct Moves {
    double from = 0, to = 0, start = 0, length = 0.5, rest = 0.2;
    double target(Rng &g, double t) {
        if (t >= start + length + rest)
            from = to, to = plants::uniform(g, -3, 3), start = t, length = plants::uniform(g, 0.3, 0.8), rest = plants::uniform(g, 0.2, 0.6);
        const double x = std::min(1.0, (t - start) / length);
        return from + (to - from) * x * x * x * (10 - 15 * x + 6 * x * x);
    }
};

// Inverse of a symmetric 4 x 4 information matrix, diagonal only.
inline void bound(const double *f, double *out) {
    double a[4][8];
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 8; j++) a[i][j] = j < 4 ? f[i * 4 + j] / std::sqrt(f[i * 5] * f[j * 5]) : j - 4 == i;
    for (int i = 0; i < 4; i++) {
        const double p = a[i][i];
        for (double &x : a[i]) x /= p;
        for (int r = 0; r < 4; r++)
            if (r != i)
                for (int j = 7; j >= 0; j--) a[r][j] -= a[r][i] * a[i][j];
    }
    for (int i = 0; i < 2; i++) out[i] = std::sqrt(a[i][4 + i] / f[i * 5]);
}

inline void run(Cell cell, uint64_t seed, Result &result, driveid_real type = DRIVEID_F64) {
    Rng g(seed * 7919 + cell);
    plants::Axis axis{1.2e-4 * std::exp(plants::uniform(g, -0.7, 0.7)), 0};
    axis.B = axis.J * plants::log_uniform(g, 0.5, 5);
    axis.omega = plants::uniform(g, -10, 10);
    const double J = axis.J, B = axis.B, h[4] = {J * 1e-4, B * 1e-4, 1, 1e-3};
    plants::Axis varied[3] = {axis, axis, axis}; // J, B, initial speed moved a little; the initial angle's sensitivity is 1
    varied[0].J += h[0], varied[1].B += h[1], varied[2].omega += h[3];

    driveid_estimator_options o{};
    o.dt_s = dt;
    plants::AxisEstimator estimator(o, "fsm", type);
    driveid_estimator *e = estimator.get();

    const double sigma = cell == quantised ? 0 : plants::log_uniform(g, 3e-4, 3e-2), lsb = 6.2831853 / 4096;
    const double f1 = plants::uniform(g, 0.3, 1.3), f2 = plants::uniform(g, 1, 3), phase = plants::uniform(g, 0, 6.28);
    const double late_s = cell == late_stamps ? plants::log_uniform(g, 1e-5, 2e-4) : 0; // each stamp is late by up to this much, unknown
    Moves moves;
    double colour = 0, load = 0, information[16] = {0};
    for (int k = 0; k * dt <= span_s; k++) {
        const double t = k * dt;
        if (cell == coloured) colour = 0.95 * colour + std::sqrt(1 - 0.95 * 0.95) * sigma * plants::gauss(g); // 20 ms
        const double noise = cell == coloured ? colour : sigma * plants::gauss(g);
        double measured = axis.theta + noise;
        if (cell == quantised) measured = std::round(axis.theta / lsb) * lsb;
        double tau = J * (120 * std::sin(6.2832 * f1 * t + phase) + 120 * std::sin(6.2832 * f2 * t));
        if (cell == rests || cell == closed_loop) { // a position loop: on the truth, or on what the noisy encoder says
            const double seen = cell == closed_loop ? measured : axis.theta, w = 40;
            tau = J * (w * w * (moves.target(g, t) - seen) - 1.6 * w * axis.omega);
        }
        if (cell == coloured) load = 0.8 * load + 0.6 * J * 2 * plants::gauss(g); // torque noise, 5 ms
        const double channel[2] = {measured, tau};
        driveid_estimator_update(e, 1 + int64_t(k) * 1000000 + (cell == late_stamps ? int64_t(1e9 * plants::uniform(g, 0, late_s)) : 0), channel);
        const double d[4] = {(varied[0].theta - axis.theta) / h[0], (varied[1].theta - axis.theta) / h[1], 1, (varied[2].theta - axis.theta) / h[3]};
        for (int i = 0; i < 4; i++)
            for (int j = 0; j < 4; j++) information[i * 4 + j] += d[i] * d[j];
        const double push = tau + (cell == coloured ? load : 0);
        axis.step(push, dt);
        for (auto &v : varied) v.step(push, dt);
    }
    driveid_estimate a;
    result.runs++;
    if (driveid_estimator_estimate(e, &a) != DRIVEID_OK && driveid_estimator_estimate(e, &a) != DRIVEID_FROZEN) return;
    result.answered++;
    double least[2];
    bound(information, least);
    const double truth[2] = {J, B};
    for (int i = 0; i < 2; i++) {
        result.covered[i] += a.lo[i] <= truth[i] && truth[i] <= a.hi[i];
        const double width = (a.hi[i] - a.lo[i]) / 2 / 1.96;
        result.width[i].push_back(width / truth[i]);
        if (sigma > 0 && cell != late_stamps) result.ratio[i].push_back(width / (least[i] * sigma));
    }
}

inline double median(std::vector<double> v) {
    if (v.empty()) return 0;
    std::nth_element(v.begin(), v.begin() + v.size() / 2, v.end());
    return v[v.size() / 2];
}

} // namespace intervals
