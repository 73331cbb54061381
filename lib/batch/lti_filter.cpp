// SPDX-License-Identifier: Apache-2.0
#include "batch/lti_filter.hpp"

namespace driveid::lti {
namespace {

// Phi = e^{A T}; x+ = Phi x + G0 v_k + G1 v_{k+1} for a first-order hold (G1 = 0 for a zero-order hold), from one block exponential.
struct Step {
    MatrixXd Phi;
    VectorXd G0, G1;
};

Step discretise(const VectorXd &f, double T_s, bool zero_order_hold) {
    const Eigen::Index n = f.size();
    MatrixXd block = MatrixXd::Zero(n + 2, n + 2);
    block.topLeftCorner(n, n) = modal::companion(static_cast<std::size_t>(n), f.data()) * T_s;
    block(n - 1, n) = T_s;
    block(n, n + 1) = 1;
    const MatrixXd e = modal::exponential(block, 1);
    Step s{e.topLeftCorner(n, n), e.block(0, n, n, 1), VectorXd::Zero(n)};
    if (!zero_order_hold) {
        s.G1 = e.block(0, n + 1, n, 1);
        s.G0 -= s.G1;
    }
    return s;
}

} // namespace

MatrixXd filtered(const VectorXd &signal, const VectorXd &f, double T_s, bool zero_order_hold) {
    const Step s = discretise(f, T_s, zero_order_hold);
    MatrixXd out(signal.size(), f.size());
    VectorXd x = VectorXd::Zero(f.size());
    for (Eigen::Index k = 0; k < signal.size(); k++) {
        out.row(k) = x;
        if (k + 1 < signal.size()) x = s.Phi * x + s.G0 * signal(k) + s.G1 * signal(k + 1);
    }
    return out;
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
