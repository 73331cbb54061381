// SPDX-License-Identifier: Apache-2.0
// From modal parameters and free responses to models: a, b, poles [EQ MOD-4.9 .. 4.63]; Prony as the peer.
#include "batch/modal_internal.hpp"

#include <algorithm>
#include <cmath>
#include <complex>

using namespace driveid::modal;

namespace {

bool valid(size_t order, size_t experiments, const driveid_modal_experiment *experiment) {
    if (order < 1 || order > order_max || !experiments || !experiment) return false;
    for (size_t e = 0; e < experiments; e++)
        if (!experiment[e].A_c || !experiment[e].c_c || !experiment[e].q || !experiment[e].modes || experiment[e].modes > 64) return false;
    return true;
}

Eigen::Index total_modes(size_t experiments, const driveid_modal_experiment *experiment) {
    Eigen::Index rows = 0;
    for (size_t e = 0; e < experiments; e++) rows += static_cast<Eigen::Index>(experiment[e].modes);
    return rows;
}

MatrixXd controller(const driveid_modal_experiment &e) {
    return Eigen::Map<const RowMajor>(e.A_c, static_cast<Eigen::Index>(e.modes), static_cast<Eigen::Index>(e.modes));
}

void write_poles(const Eigen::VectorXcd &pole, double *re, double *im) {
    // Sorted by frequency, then damping, conjugates together (positive imaginary part first): matched by value, never by luck.
    std::vector<std::complex<double>> s(pole.begin(), pole.end());
    std::sort(s.begin(), s.end(), [](auto a, auto b) {
        const double fa = std::abs(a.imag()), fb = std::abs(b.imag());
        if (std::abs(fa - fb) > 1e-9 * (1 + fa + fb)) return fa < fb;
        if (std::abs(a.real() - b.real()) > 1e-9 * (1 + std::abs(a.real()))) return a.real() < b.real();
        return a.imag() > b.imag();
    });
    for (size_t k = 0; k < s.size(); k++) {
        re[k] = s[k].real();
        im[k] = s[k].imag();
    }
}

} // namespace

driveid_status driveid_modal_a(size_t order, const double *p, double *a) {
    if (!p || !a || order < 1 || order > order_max) return DRIVEID_ERR_ARGUMENT;
    const auto n = static_cast<Eigen::Index>(order);
    const MatrixXd P = Eigen::Map<const RowMajor>(p, n, n);
    const VectorXd last = Eigen::Map<const VectorXd>(p + order * order, n);
    const auto x = solve(P.transpose(), -last);
    if (!x) return DRIVEID_RANK;
    Eigen::Map<VectorXd>(a, n) = x->col(0);
    return DRIVEID_OK;
}

driveid_status driveid_modal_b(size_t order, size_t zeros, const double *a, size_t experiments, const driveid_modal_experiment *experiment, double *b) {
    if (!a || !b || zeros >= order || !valid(order, experiments, experiment)) return DRIVEID_ERR_ARGUMENT;
    const Eigen::Index rows = total_modes(experiments, experiment), columns = static_cast<Eigen::Index>(zeros) + 1;
    MatrixXd R(rows, columns);
    VectorXd q(rows);
    Eigen::Index at = 0;
    for (size_t e = 0; e < experiments; e++) {
        const auto modes = static_cast<Eigen::Index>(experiment[e].modes);
        const MatrixXd At = controller(experiment[e]).transpose();
        VectorXd power = Eigen::Map<const VectorXd>(experiment[e].c_c, modes);
        for (Eigen::Index j = 0; j < columns; j++, power = (At * power).eval()) R.block(at, j, modes, 1) = power;
        const Eigen::Map<const RowMajor> Q(experiment[e].q, static_cast<Eigen::Index>(order) + 1, modes);
        q.segment(at, modes) = Q.row(static_cast<Eigen::Index>(order)).transpose();
        for (size_t j = 0; j < order; j++) q.segment(at, modes) += a[j] * Q.row(static_cast<Eigen::Index>(j)).transpose();
        at += modes;
    }
    const auto x = solve(R, q);
    if (!x) return DRIVEID_RANK;
    Eigen::Map<VectorXd>(b, columns) = x->col(0);
    return DRIVEID_OK;
}

driveid_status driveid_modal_ab(size_t order, double T_s, const int32_t *shift, const double *p_o, size_t experiments,
                                const driveid_modal_experiment *experiment, double *a, double *b) {
    if (!shift || !p_o || !a || !b || !(T_s > 0) || !valid(order, experiments, experiment)) return DRIVEID_ERR_ARGUMENT;
    const auto n = static_cast<Eigen::Index>(order);
    const Eigen::Index rows = total_modes(experiments, experiment);
    MatrixXd R(rows, 2 * n);
    VectorXd right(rows);
    Eigen::Index at = 0;
    for (size_t e = 0; e < experiments; e++) {
        const auto modes = static_cast<Eigen::Index>(experiment[e].modes);
        const MatrixXd A = controller(experiment[e]), At = A.transpose();
        MatrixXd filter = MatrixXd::Identity(modes, modes);  // [EQ MOD-4.5]
        for (size_t i = 0; i < order; i++) filter += p_o[e * order + i] * exponential(A, -shift[i] * T_s);
        VectorXd nu = filter.transpose() * Eigen::Map<const VectorXd>(experiment[e].c_c, modes);
        VectorXd q = Eigen::Map<const VectorXd>(experiment[e].q, modes);
        for (Eigen::Index j = 0; j < n; j++) {
            R.block(at, j, modes, 1) = q;
            R.block(at, n + j, modes, 1) = -nu;
            q = (At * q).eval();
            nu = (At * nu).eval();
        }
        right.segment(at, modes) = -q;
        at += modes;
    }
    const auto x = solve(R, right);
    if (!x) return DRIVEID_RANK;
    Eigen::Map<VectorXd>(a, n) = x->col(0).head(n);
    Eigen::Map<VectorXd>(b, n) = x->col(0).tail(n);
    return DRIVEID_OK;
}

driveid_status driveid_modal_free_response(size_t order, double T_s, size_t rows, const double *y, const int32_t *shift, size_t start,
                                           size_t block, size_t hop, size_t blocks, driveid_quadrature quadrature, int untustin,
                                           double *a, double *re, double *im) {
    if (!y || !shift || !a || !re || !im || order < 1 || order > order_max || blocks < order || !block || !(T_s > 0)) return DRIVEID_ERR_ARGUMENT;
    const auto n = static_cast<Eigen::Index>(order);
    const VectorXd weight = quadrature_weights(block, T_s, quadrature);
    if (weight.size() == 0) return DRIVEID_ERR_ARGUMENT;
    MatrixXd Y(n, static_cast<Eigen::Index>(blocks)), Z(n, static_cast<Eigen::Index>(blocks));
    for (size_t k = 0; k < blocks; k++)
        for (Eigen::Index i = 0; i < n; i++) {
            const auto first = static_cast<int64_t>(start + k * hop) - shift[i];
            if (first < 0 || first + static_cast<int64_t>(block) >= static_cast<int64_t>(rows)) return DRIVEID_ERR_ARGUMENT;
            Y(i, static_cast<Eigen::Index>(k)) = y[first + static_cast<int64_t>(block)] - y[first];
            Z(i, static_cast<Eigen::Index>(k)) = weight.dot(Eigen::Map<const VectorXd>(y + first, weight.size()));
        }
    const auto transposed = solve(Z.transpose(), Y.transpose());  // Lambda = Y Z^+ [EQ MOD-4.55]
    if (!transposed) return DRIVEID_RANK;
    Eigen::VectorXcd pole = eigenvalues(transposed->transpose());
    if (!untustin) {
        Eigen::Map<VectorXd>(a, n) = characteristic(transposed->transpose());
    } else {
        // The trapezoid sees s' = (2/T) tanh(s T/2).
        Eigen::VectorXcd polynomial = Eigen::VectorXcd::Zero(n + 1);
        polynomial(0) = 1;
        for (Eigen::Index k = 0; k < n; k++) {
            pole(k) = 2 / T_s * std::atanh(pole(k) * T_s / 2.0);
            for (Eigen::Index j = k + 1; j > 0; j--) polynomial(j) = polynomial(j - 1) - pole(k) * polynomial(j);
            polynomial(0) *= -pole(k);
        }
        Eigen::Map<VectorXd>(a, n) = polynomial.head(n).real();
    }
    write_poles(pole, re, im);
    return DRIVEID_OK;
}

driveid_status driveid_modal_deflate(size_t order, size_t controller_order, const double *a_aug, const double *a_c, double *a) {
    if (!a_aug || !a_c || !a || order < 1 || !controller_order || order > order_max || controller_order > 64) return DRIVEID_ERR_ARGUMENT;
    const auto n = static_cast<Eigen::Index>(order), c = static_cast<Eigen::Index>(controller_order);
    MatrixXd product = MatrixXd::Zero(n + c, n);
    VectorXd right = Eigen::Map<const VectorXd>(a_aug, n + c);
    for (Eigen::Index j = 0; j < n; j++) {
        for (Eigen::Index i = 0; i < c; i++) product(i + j, j) += a_c[i];
        product(c + j, j) += 1;
    }
    right.segment(n, c) -= Eigen::Map<const VectorXd>(a_c, c);  // from s^n * P_c(s)
    const auto x = solve(product, right);
    if (!x) return DRIVEID_RANK;
    Eigen::Map<VectorXd>(a, n) = x->col(0);
    return DRIVEID_OK;
}

driveid_status driveid_prony(size_t order, double T_s, size_t rows, const double *y, size_t lag, size_t equations, double *re, double *im,
                             double *condition) {
    if (!y || !re || !im || order < 1 || order > order_max || !lag || equations < order || !(T_s > 0)) return DRIVEID_ERR_ARGUMENT;
    if ((order + equations - 1) * lag >= rows) return DRIVEID_ERR_ARGUMENT;
    const auto n = static_cast<Eigen::Index>(order);
    MatrixXd R(static_cast<Eigen::Index>(equations), n);
    VectorXd z(static_cast<Eigen::Index>(equations));
    for (Eigen::Index m = 0; m < z.size(); m++) {
        const size_t now = order + static_cast<size_t>(m);
        z(m) = y[now * lag];
        for (Eigen::Index k = 0; k < n; k++) R(m, k) = y[(now - 1 - static_cast<size_t>(k)) * lag];
    }
    const auto x = solve(R, -z);
    if (!x) return DRIVEID_RANK;
    VectorXd a(n);  // z^n + p_1 z^(n-1) + .. + p_n
    for (Eigen::Index k = 0; k < n; k++) a(n - 1 - k) = (*x)(k, 0);
    Eigen::VectorXcd root = eigenvalues(companion(order, a.data()));
    for (auto &z_k : root) z_k = std::log(std::complex<double>(z_k)) / (static_cast<double>(lag) * T_s);
    write_poles(root, re, im);
    if (condition) {
        const VectorXd singular = singular_values(R);
        *condition = singular(0) / singular(n - 1);
    }
    return DRIVEID_OK;
}
