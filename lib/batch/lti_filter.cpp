// SPDX-License-Identifier: Apache-2.0
#include "batch/lti_filter.hpp"

namespace driveid::lti {
namespace {

// Phi = e^{A T}; x+ = Phi x + G0 v_k + G1 v_{k+1} for a first-order hold (G1 = 0 for a zero-order hold), from one block exponential.
struct Step {
    MatrixXd Phi;
    VectorXd G0, G1;
};

// x' = A x + e_(input) v
Step discretise(const MatrixXd &A, Eigen::Index input, double T_s, bool zero_order_hold) {
    const Eigen::Index n = A.rows();
    MatrixXd block = MatrixXd::Zero(n + 2, n + 2);
    block.topLeftCorner(n, n) = A * T_s;
    block(input, n) = T_s;
    block(n, n + 1) = 1;
    const MatrixXd e = modal::exponential(block, 1);
    Step s{e.topLeftCorner(n, n), e.block(0, n, n, 1), VectorXd::Zero(n)};
    if (!zero_order_hold) {
        s.G1 = e.block(0, n + 1, n, 1);
        s.G0 -= s.G1;
    }
    return s;
}

// The last `keep` states at every sample, from the state x.
MatrixXd states(const Step &s, const VectorXd &signal, VectorXd x, Eigen::Index keep) {
    MatrixXd out(signal.size(), keep);
    for (Eigen::Index k = 0; k < signal.size(); k++) {
        out.row(k) = x.tail(keep);
        if (k + 1 < signal.size()) x = (s.Phi * x + s.G0 * signal(k) + s.G1 * signal(k + 1)).eval();
    }
    return out;
}

MatrixXd companion(const VectorXd &f) { return modal::companion(static_cast<std::size_t>(f.size()), f.data()); }

} // namespace

MatrixXd filtered(const VectorXd &signal, const VectorXd &f, double T_s, bool zero_order_hold) {
    return states(discretise(companion(f), f.size() - 1, T_s, zero_order_hold), signal, VectorXd::Zero(f.size()), f.size());
}

MatrixXd cascaded(const VectorXd &u, const VectorXd &a, const VectorXd &b, const VectorXd &c, const VectorXd &f, double T_s, bool zero_order_hold) {
    const Eigen::Index n = a.size();
    MatrixXd both = MatrixXd::Zero(2 * n, 2 * n);
    both.topLeftCorner(n, n) = companion(a);
    both.bottomRightCorner(n, n) = companion(f);
    both.row(2 * n - 1).head(b.size()) = b.transpose();
    MatrixXd out = states(discretise(both, n - 1, T_s, zero_order_hold), u, VectorXd::Zero(2 * n), n);
    if (c.size() == 0) return out;
    both.row(2 * n - 1).head(n) = c.transpose();
    return out + states(discretise(both, n - 1, T_s, true), VectorXd::Zero(u.size()), VectorXd::Unit(2 * n, n - 1), n);
}

MatrixXd impulses(const VectorXd &f, double T_s, Eigen::Index rows) {
    const Eigen::Index n = f.size();
    const MatrixXd Phi = modal::exponential(modal::companion(static_cast<std::size_t>(n), f.data()), T_s);
    MatrixXd out(rows, n);
    // The impulse response of 1/F starts at e_n; its derivatives are the other states.
    VectorXd x = VectorXd::Unit(n, n - 1);
    for (Eigen::Index k = 0; k < rows; k++, x = (Phi * x).eval()) out.row(k) = x;
    return out;
}

VectorXd highest(const VectorXd &signal, const MatrixXd &derivatives, const VectorXd &f) { return signal - derivatives * f; }

VectorXd delayed(const VectorXd &u, std::size_t samples, double before) {
    VectorXd out = VectorXd::Constant(u.size(), before);
    const auto d = static_cast<Eigen::Index>(samples);
    if (d < u.size()) out.tail(u.size() - d) = u.head(u.size() - d);
    return out;
}

} // namespace driveid::lti
