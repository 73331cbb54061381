// SPDX-License-Identifier: Apache-2.0
// The drive train of Fliess et al. 2006 and what its identifiers are judged by. Truth: its transfer function, sampled exactly through residues.
#pragma once

#include <driveid/discrete.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "exponentials.hpp"

namespace drive_train_of_fliess {

using namespace truth;

inline System drive_train() {
    const C slow = 12.4 * C(-.1, std::sqrt(1 - .01)), fast = 27.7 * C(-.0083, std::sqrt(1 - .0083 * .0083));
    System g{{1}, {C(-8.1, 0), slow, std::conj(slow), fast, std::conj(fast)}};
    g.b[0] = 23.7 * g.denominator(0).real();
    return g;
}

// The input that fits the noise-free entries of table (10): 0, then +1 from 0.05 s, then -0.96 from 0.8 s (NOTES B4).
struct Samples {
    std::vector<double> y, u;
};
inline Samples simulated(double T, double noise = 0, unsigned seed = 0) {
    const System g = drive_train();
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    Samples r;
    const int K = static_cast<int>(std::lround(1.35 / T));
    double peak = 0, coloured = 0;
    for (int k = 0; k < K; k++) {
        const double t = k * T;
        r.u.push_back(t < .05 - T / 2 ? 0 : t < .8 - T / 2 ? 1 : -.96);
        r.y.push_back(g.steps({{.05, 1}, {.8, -1.96}}, t));
        peak = std::max(peak, std::abs(r.y.back()));
    }
    const double pole = std::exp(-T / .02);  // AR(1), 20 ms
    for (double &y : r.y) y += noise * peak * (coloured = pole * coloured + std::sqrt(1 - pole * pole) * normal(random));
    return r;
}

inline driveid_discrete_config config(driveid_discrete_domain domain, int kept, double T) {
    return {domain, 5, 4, static_cast<uint8_t>(kept), 7, 10, static_cast<uint32_t>(std::lround(1.35 / T)), T, 1.0};
}

// Poles in s from the estimate, by eigenvalues of the companion matrix.
inline std::vector<C> poles(const driveid_discrete_estimate &e, driveid_discrete_domain domain, double T) {
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(5, 5);
    A.topRightCorner(4, 4).setIdentity();
    for (int i = 0; i < 5; i++)
        A(4, i) = domain == DRIVEID_DISCRETE_Z ? -e.theta[i] : -(i == 0 ? 1 : e.theta[i - 1]) / e.theta[4];
    std::vector<C> s;
    const Eigen::VectorXcd roots = Eigen::EigenSolver<Eigen::MatrixXd>(A).eigenvalues();
    for (const C root : roots)
        s.push_back(domain == DRIVEID_DISCRETE_Z ? std::log(root) / T : 2 / T * std::atanh(root * T / 2.0));
    return s;
}

// Largest relative distance of a true pole of the pair to the nearest estimate.
inline double pole_error(const std::vector<C> &found, C truth_pole) {
    double best = 1e9;
    for (const C &s : found) best = std::min(best, std::abs(s - truth_pole) / std::abs(truth_pole));
    return best;
}

template <class Estimator>
driveid_status identify(Estimator &e, const driveid_discrete_config &c, const Samples &r, driveid_discrete_estimate &out) {
    driveid_status status = DRIVEID_NOT_YET;
    for (size_t k = 0; k < r.y.size(); k++) {
        if constexpr (std::is_same_v<Estimator, driveid_discrete_f64>) status = driveid_discrete_update_f64(&e, r.y[k], r.u[k]);
        else status = driveid_discrete_update_f32(&e, static_cast<float>(r.y[k]), static_cast<float>(r.u[k]));
    }
    (void)c;
    if (status != DRIVEID_OK) return status;
    if constexpr (std::is_same_v<Estimator, driveid_discrete_f64>) return driveid_discrete_estimate_f64(&e, &out);
    else return driveid_discrete_estimate_f32(&e, &out);
}

} // namespace drive_train_of_fliess
