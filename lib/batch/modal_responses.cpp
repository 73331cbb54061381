// SPDX-License-Identifier: Apache-2.0
// Frequency, step and impulse response and the minimum-time observer from modal functions [EQ MOD-5.14 .. 6.36].
#include "batch/modal_internal.hpp"

#include <algorithm>
#include <cmath>

using namespace driveid::modal;

namespace {

// Delta: u-bar' Delta = [v(k) .. v(k-n+1) u(k-n)] [EQ MOD-5.30].
MatrixXd differences(Eigen::Index n) {
    MatrixXd D = MatrixXd::Identity(n + 1, n + 1);
    for (Eigen::Index i = 0; i < n; i++) D(i + 1, i) = -1;
    return D;
}

// L: lower triangular Toeplitz of 1, p_o1 .. p_on [EQ MOD-5.34].
MatrixXd toeplitz(Eigen::Index n, const double *p_o) {
    MatrixXd L = MatrixXd::Identity(n + 1, n + 1);
    for (Eigen::Index j = 0; j <= n; j++)
        for (Eigen::Index i = j + 1; i <= n; i++) L(i, j) = p_o[i - j - 1];
    return L;
}

} // namespace

driveid_status driveid_modal_frequency_response(const driveid_modal_task *task, const double *u, const double *p_o, size_t count,
                                                const double *omega, double *re, double *im) {
    if (!task || !u || !p_o || !omega || !re || !im || !fits(*task) || task->windows != 1) return DRIVEID_ERR_ARGUMENT;
    const size_t first = task->first[0], intervals = task->last[0] - first;
    const VectorXd weight = quadrature_weights(intervals, task->T_s, task->quadrature);
    if (weight.size() == 0) return DRIVEID_ERR_ARGUMENT;
    std::vector<Eigen::Vector2d> answer(count);
    for (size_t c = 0; c < count; c++) {
        Eigen::Vector2d q(0, 0), nu(0, 0);
        for (size_t k = 0; k <= intervals; k++) {
            double y_o = task->y[first + k], u_o = u[first + k];
            for (size_t i = 0; i < task->order; i++) {
                const auto index = static_cast<int64_t>(first + k) - task->shift[i];
                y_o += p_o[i] * task->y[index];
                u_o += p_o[i] * u[index];
            }
            const double phase = omega[c] * static_cast<double>(k) * task->T_s;
            const Eigen::Vector2d basis(std::sin(phase), std::cos(phase));
            q += weight(static_cast<Eigen::Index>(k)) * y_o * basis;
            nu += weight(static_cast<Eigen::Index>(k)) * u_o * basis;
        }
        const double power = nu.squaredNorm();
        if (!(power > 0)) return DRIVEID_RANK;
        answer[c] = {(q(0) * nu(0) + q(1) * nu(1)) / power, (q(1) * nu(0) - q(0) * nu(1)) / power};
    }
    for (size_t c = 0; c < count; c++) {
        re[c] = answer[c](0);
        im[c] = answer[c](1);
    }
    return DRIVEID_OK;
}

driveid_status driveid_modal_step_response(size_t order, size_t rows, const double *y, size_t hold, size_t levels, const double *u_level,
                                           const double *p_o, size_t count, double *g) {
    if (!y || !u_level || !p_o || !g || order < 1 || order > order_max || !hold || levels < 2 * order + 1 || !count) return DRIVEID_ERR_ARGUMENT;
    const auto n = static_cast<Eigen::Index>(order);
    const size_t equations = levels - order;
    if (levels * hold > rows) return DRIVEID_ERR_ARGUMENT;
    MatrixXd U(static_cast<Eigen::Index>(equations), n + 1), Y_o(static_cast<Eigen::Index>(equations), static_cast<Eigen::Index>(hold));
    for (size_t e = 0; e < equations; e++) {
        const size_t k = order + e;
        for (Eigen::Index i = 0; i <= n; i++) U(static_cast<Eigen::Index>(e), i) = u_level[k - static_cast<size_t>(i)];
        for (size_t s = 0; s < hold; s++) {
            double value = y[k * hold + s];
            for (size_t i = 0; i < order; i++) value += p_o[i] * y[(k - 1 - i) * hold + s];
            Y_o(static_cast<Eigen::Index>(e), static_cast<Eigen::Index>(s)) = value;
        }
    }
    const auto x = solve(U, Y_o);
    if (!x) return DRIVEID_RANK;
    const MatrixXd G = inverse(differences(n) * toeplitz(n, p_o)) * *x;  // row i, column s: g(s + iT)
    std::vector<double> out(std::max(count, (order + 1) * hold));
    for (size_t i = 0; i <= order; i++)
        for (size_t s = 0; s < hold; s++) out[i * hold + s] = G(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(s));
    for (size_t k = (order + 1) * hold; k < out.size(); k++) {
        double value = out[k - hold];
        for (size_t i = 1; i <= order; i++) value += p_o[i - 1] * (out[k - (i + 1) * hold] - out[k - i * hold]);
        out[k] = value;
    }
    std::copy(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(count), g);
    return DRIVEID_OK;
}

driveid_status driveid_modal_impulse_response(size_t order, double T_s, size_t rows, const double *g, size_t hold, size_t period,
                                              size_t functions, size_t count, double *h) {
    if (!g || !h || order < 1 || order > order_max || !hold || !(T_s > 0) || functions % 2 || functions < order + 1) return DRIVEID_ERR_ARGUMENT;
    if (period + order * hold >= rows || count + order * hold > rows) return DRIVEID_ERR_ARGUMENT;
    const driveid_quadrature rule = period % 2 ? DRIVEID_QUADRATURE_TRAPEZOID : DRIVEID_QUADRATURE_SIMPSON;
    const VectorXd weight = quadrature_weights(period, T_s, rule);
    const auto n = static_cast<Eigen::Index>(order), half = static_cast<Eigen::Index>(functions / 2);
    const double T_o = static_cast<double>(period) * T_s, omega = 2 * M_PI / T_o;
    // Unknowns p_11 .. p_1n and g(T_o) [EQ MOD-5.41]; the constant q_1o follows from 5.42.
    MatrixXd R = MatrixXd::Zero(2 * half, n + 1);
    VectorXd right = VectorXd::Zero(2 * half);
    VectorXd mean = VectorXd::Zero(n);
    for (size_t k = 0; k <= period; k++) {
        const double w = weight(static_cast<Eigen::Index>(k));
        Eigen::RowVectorXd shifted(n);
        for (Eigen::Index i = 0; i < n; i++) shifted(i) = g[k + (static_cast<size_t>(i) + 1) * hold];
        mean += w * shifted.transpose();
        for (Eigen::Index m = 0; m < half; m++) {
            const double rate = static_cast<double>(m + 1) * omega, phase = rate * static_cast<double>(k) * T_s;
            R.row(m).head(n) += w * std::sin(phase) * shifted;
            R.row(half + m).head(n) += w * std::cos(phase) * shifted;
            right(m) += w * g[k] * rate * std::cos(phase);
            right(half + m) -= w * g[k] * rate * std::sin(phase);
        }
    }
    R.col(n).tail(half).setOnes();
    const auto x = solve(R, right);
    if (!x) return DRIVEID_RANK;
    const VectorXd p = x->col(0).head(n);
    const double q = ((*x)(n, 0) - g[0] + p.dot(mean)) / T_o;
    std::vector<double> out(count);
    for (size_t k = 0; k < count; k++) {
        out[k] = q;
        for (Eigen::Index i = 0; i < n; i++) out[k] -= p(i) * g[k + (static_cast<size_t>(i) + 1) * hold];
    }
    std::copy(out.begin(), out.end(), h);
    return DRIVEID_OK;
}

driveid_status driveid_modal_observer(size_t order, const double *p, size_t hold, const double *g, size_t phase, double *Q) {
    if (!p || !g || !Q || order < 1 || order > order_max || !hold || phase >= hold) return DRIVEID_ERR_ARGUMENT;
    const auto n = static_cast<Eigen::Index>(order);
    const auto gamma = [&](const double *row) {  // [EQ MOD-6.19]
        MatrixXd G = MatrixXd::Zero(n + 1, n + 1);
        G(0, 0) = 1;
        for (Eigen::Index i = 0; i < n; i++)
            for (Eigen::Index j = 0; i + j < n; j++) G(i + 1, j + 1) = row[i + j];
        return G;
    };
    const auto unknowns = [&](size_t s) -> VectorXd {  // [q~_oo, r(s)] [EQ MOD-6.27, 6.29]
        VectorXd samples(n + 1);
        for (Eigen::Index i = 0; i <= n; i++) samples(i) = g[s + static_cast<size_t>(i) * hold];
        const VectorXd q_o = differences(n) * toeplitz(n, p) * samples;
        return inverse(differences(n).transpose() * gamma(p)) * q_o;
    };
    if (p[order - 1] == 0) return DRIVEID_RANK;  // Gamma_o is then singular
    const VectorXd at_zero = unknowns(0), at_phase = unknowns(phase);
    Eigen::Map<RowMajor> out(Q, n, n + 1);
    for (Eigen::Index j = 0; j < n; j++) {
        const double *row = p + static_cast<size_t>(j) * order;
        VectorXd right = at_phase;
        right(0) = Eigen::Map<const VectorXd>(row, n).dot(at_zero.tail(n));  // [EQ MOD-6.26]
        out.row(j) = (differences(n).transpose() * gamma(row) * right).transpose();
    }
    return DRIVEID_OK;
}

driveid_status driveid_modal_state_input(size_t order, const double *p, size_t hold, size_t rows, const double *g, double *b) {
    if (!p || !g || !b || order < 1 || order > order_max || !hold || rows < (order + 1) * hold + 1) return DRIVEID_ERR_ARGUMENT;
    const auto n = static_cast<Eigen::Index>(order);
    const Eigen::Map<const RowMajor> all(p, n + 1, n);
    RowMajor Q(n, n + 1);
    std::vector<double> a(order);
    driveid_status status = driveid_modal_observer(order, p, hold, g, 0, Q.data());
    if (status == DRIVEID_OK) status = driveid_modal_a(order, p, a.data());
    if (status != DRIVEID_OK) return status;
    double q_o = 0;  // constant once the window lies behind the step: its mean
    for (size_t k = order * hold; k < rows; k++) {
        q_o += g[k];
        for (size_t i = 0; i < order; i++) q_o += p[i] * g[k - (i + 1) * hold];
    }
    q_o /= static_cast<double>(rows - order * hold);
    const double unit = 1 + all.row(0).sum();  // what the modal filter leaves of a constant
    if (std::abs(unit) < 1e-9 * (1 + all.row(0).cwiseAbs().sum())) return DRIVEID_RANK;
    const VectorXd of_state = Q.rowwise().sum();  // the states' modal functions of a constant input of 1
    b[n - 1] = q_o / unit * all.row(n).sum();
    for (Eigen::Index j = 0; j < n; j++) b[n - 1] += a[static_cast<size_t>(j)] * of_state(j);
    for (Eigen::Index j = 1; j < n; j++) b[j - 1] = q_o / unit * all.row(j).sum() - of_state(j);
    return DRIVEID_OK;
}
