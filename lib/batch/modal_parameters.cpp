// SPDX-License-Identifier: Apache-2.0
// Modal parameters p_j, q_j from samples, Fourier or Walsh averages [EQ MOD-3.1 .. 3.37].
#include "batch/modal_internal.hpp"

#include <cmath>
#include <numbers>

namespace driveid::modal {
namespace {

// r(t_k)' = [y(t_k - T_1) .. y(t_k - T_n)  -x_c(t_k)'] with the y part moved by `offset` samples [EQ MOD-3.3].
Eigen::RowVectorXd regressor(const driveid_modal_task &t, std::size_t k, std::int64_t offset = 0) {
    Eigen::RowVectorXd r(t.order + t.modes);
    for (std::size_t i = 0; i < t.order; i++) r(i) = t.y[static_cast<std::int64_t>(k) - t.shift[i] + offset];
    for (std::size_t m = 0; m < t.modes; m++) r(t.order + m) = -t.mode[k * t.modes + m];
    return r;
}

struct Averages {
    MatrixXd R;  // functions x (order + modes): integrals of f r'
    VectorXd z;  // functions: integral of f y
};

// Integrals against Fourier functions whose period is the total length of the windows.
std::optional<Averages> fourier(const driveid_modal_task &t) {
    if (t.functions < 2 || t.functions % 2) return std::nullopt;
    std::size_t total = 0;
    for (std::size_t w = 0; w < t.windows; w++) total += t.last[w] - t.first[w];
    const double omega = 2 * std::numbers::pi / (static_cast<double>(total) * t.T_s);
    const std::size_t half = t.functions / 2;
    Averages out{MatrixXd::Zero(t.functions, t.order + t.modes), VectorXd::Zero(t.functions)};
    double elapsed = 0;
    for (std::size_t w = 0; w < t.windows; w++) {
        const std::size_t intervals = t.last[w] - t.first[w];
        const VectorXd weight = quadrature_weights(intervals, t.T_s, t.quadrature);
        if (weight.size() == 0) return std::nullopt;
        for (std::size_t k = 0; k <= intervals; k++) {
            const double time = elapsed + static_cast<double>(k) * t.T_s;
            VectorXd f(t.functions);
            for (std::size_t m = 0; m < half; m++) {
                const double phase = static_cast<double>(m + 1) * omega * time;
                f(m) = std::sin(phase);
                f(half + m) = std::cos(phase);
            }
            f *= weight(k);
            out.R += f * regressor(t, t.first[w] + k);
            out.z += f * t.y[t.first[w] + k];
        }
        elapsed += static_cast<double>(intervals) * t.T_s;
    }
    return out;
}

// Sum and difference butterflies: the Walsh transform of each column, rows in natural (Hadamard) order.
void fast_walsh(MatrixXd &columns) {
    for (Eigen::Index half = 1; half < columns.rows(); half *= 2)
        for (Eigen::Index start = 0; start < columns.rows(); start += 2 * half)
            for (Eigen::Index i = start; i < start + half; i++) {
                const Eigen::RowVectorXd a = columns.row(i), b = columns.row(i + half);
                columns.row(i) = a + b;
                columns.row(i + half) = a - b;
            }
}

// Blocks of the concatenated windows, each inside one window: index of the first sample of every block, and its length.
std::optional<std::vector<std::size_t>> blocks(const driveid_modal_task &t, std::size_t &length) {
    std::size_t total = 0;
    for (std::size_t w = 0; w < t.windows; w++) total += t.last[w] - t.first[w];
    if (t.functions < 2 || (t.functions & (t.functions - 1)) || total % t.functions) return std::nullopt;
    length = total / t.functions;
    std::vector<std::size_t> start;
    for (std::size_t w = 0; w < t.windows; w++) {
        if ((t.last[w] - t.first[w]) % length) return std::nullopt;
        for (std::size_t k = t.first[w]; k < t.last[w]; k += length) start.push_back(k);
    }
    return start;
}

std::optional<Averages> walsh(const driveid_modal_task &t) {
    std::size_t length = 0;
    const auto start = blocks(t, length);
    if (!start) return std::nullopt;
    const VectorXd weight = quadrature_weights(length, t.T_s, t.quadrature);
    if (weight.size() == 0) return std::nullopt;
    MatrixXd integral = MatrixXd::Zero(t.functions, t.order + t.modes + 1);
    for (std::size_t b = 0; b < start->size(); b++)
        for (std::size_t k = 0; k <= length; k++) {
            integral.row(b).head(t.order + t.modes) += weight(k) * regressor(t, (*start)[b] + k);
            integral(b, t.order + t.modes) += weight(k) * t.y[(*start)[b] + k];
        }
    fast_walsh(integral);
    return Averages{integral.leftCols(t.order + t.modes), integral.col(t.order + t.modes)};
}

// Psi (R_d^- - R_d^+) [EQ MOD-3.37]: differences of the regressors over each block, transformed.
MatrixXd walsh_differences(const driveid_modal_task &t) {
    std::size_t length = 0;
    const auto start = blocks(t, length);
    MatrixXd difference(t.functions, t.order + t.modes);
    for (std::size_t b = 0; b < start->size(); b++)
        difference.row(b) = regressor(t, (*start)[b]) - regressor(t, (*start)[b] + length);
    fast_walsh(difference);
    return difference;
}

std::optional<VectorXd> from_samples(const driveid_modal_task &t) {
    if (!t.stride || !fits(t, t.instrument)) return std::nullopt;
    std::vector<std::size_t> instant;
    for (std::size_t w = 0; w < t.windows; w++)
        for (std::size_t k = t.first[w]; k <= t.last[w]; k += t.stride) instant.push_back(k);
    MatrixXd R(instant.size(), t.order + t.modes), V(instant.size(), t.order + t.modes);
    VectorXd z(instant.size());
    for (std::size_t r = 0; r < instant.size(); r++) {
        R.row(r) = regressor(t, instant[r]);
        V.row(r) = regressor(t, instant[r], t.instrument);
        z(r) = t.y[instant[r]];
    }
    if (!t.instrument) {
        const auto x = solve(R, z);
        if (!x) return std::nullopt;
        return VectorXd(-*x);
    }
    // The instrument's span: with V = Q S, (V'R)^-1 V'z = (Q'R)^-1 Q'z, which squares no condition number.
    const MatrixXd Q = orthonormal_columns(V);
    const auto x = solve(Q.transpose() * R, Q.transpose() * z);
    if (!x) return std::nullopt;
    return VectorXd(-*x);
}

void store(const VectorXd &theta, const driveid_modal_task &t, std::size_t j, double *p, double *q) {
    for (std::size_t i = 0; i < t.order; i++) p[j * t.order + i] = theta(i);
    for (std::size_t m = 0; q && m < t.modes; m++) q[j * t.modes + m] = theta(t.order + m);
}

// [EQ MOD-3.26, 3.30]: the spectrum of the next derivative from the last one and the unknown boundary difference c.
std::optional<std::vector<VectorXd>> fourier_derivatives(const driveid_modal_task &t, const Averages &average, std::size_t derivatives) {
    const auto half = static_cast<Eigen::Index>(t.functions / 2);
    double total = 0;
    for (std::size_t w = 0; w < t.windows; w++) total += static_cast<double>(t.last[w] - t.first[w]);
    const double omega = 2 * std::numbers::pi / (total * t.T_s);
    const VectorXd frequency = VectorXd::LinSpaced(half, 1, static_cast<double>(half)) * omega;
    VectorXd boundary(t.functions);
    boundary << VectorXd::Zero(half), VectorXd::Ones(half);
    MatrixXd bordered(t.functions, average.R.cols() + 1);
    bordered << average.R, boundary;

    std::vector<VectorXd> theta;
    VectorXd z = average.z;
    for (std::size_t j = 0; j <= derivatives; j++) {
        if (j == 0) {
            const auto x = solve(average.R, z);
            if (!x) return std::nullopt;
            theta.push_back(-*x);
            continue;
        }
        VectorXd rotated(t.functions);  // Omega z
        rotated << frequency.cwiseProduct(z.tail(half)), -frequency.cwiseProduct(z.head(half));
        const auto x = solve(bordered, rotated);
        if (!x) return std::nullopt;
        theta.push_back(x->col(0).head(average.R.cols()));
        z = -rotated + boundary * (*x)(average.R.cols(), 0);
    }
    return theta;
}

std::optional<std::vector<VectorXd>> estimate(const driveid_modal_task &t, std::size_t derivatives) {
    if (t.basis == DRIVEID_BASIS_SAMPLES) {
        const auto theta = from_samples(t);
        if (!theta) return std::nullopt;
        return std::vector<VectorXd>{*theta};
    }
    const auto average = t.basis == DRIVEID_BASIS_FOURIER ? fourier(t) : walsh(t);
    if (!average) return std::nullopt;
    if (t.basis == DRIVEID_BASIS_FOURIER) return fourier_derivatives(t, *average, derivatives);
    const auto first = solve(average->R, average->z);
    if (!first) return std::nullopt;
    std::vector<VectorXd> theta{-*first};
    const MatrixXd difference = derivatives ? walsh_differences(t) : MatrixXd();
    for (std::size_t j = 1; j <= derivatives; j++) {
        const auto x = solve(average->R, difference * theta.back());
        if (!x) return std::nullopt;
        theta.push_back(-*x);
    }
    return theta;
}

} // namespace
} // namespace driveid::modal

using namespace driveid::modal;

driveid_status driveid_modal_parameters(const driveid_modal_task *task, size_t derivatives, double *p, double *q) {
    if (!task || !p || (task->modes && !q) || !fits(*task)) return DRIVEID_ERR_ARGUMENT;
    // Derivatives need one unbroken window; samples give none.
    if (derivatives && (task->basis == DRIVEID_BASIS_SAMPLES || task->windows != 1)) return DRIVEID_ERR_ARGUMENT;
    if (task->basis == DRIVEID_BASIS_SAMPLES && (!task->stride || !fits(*task, task->instrument))) return DRIVEID_ERR_ARGUMENT;
    const auto theta = estimate(*task, derivatives);
    if (!theta) return DRIVEID_RANK;
    for (size_t j = 0; j <= derivatives; j++) store((*theta)[j], *task, j, p, q);
    return DRIVEID_OK;
}

driveid_status driveid_modal_parameters_from_a(size_t order, const double *a, double T_s, const int32_t *shift, size_t derivatives, double *p) {
    if (!a || !shift || !p || order < 1 || order > order_max || !(T_s > 0)) return DRIVEID_ERR_ARGUMENT;
    const MatrixXd A = companion(order, a);
    const auto n = static_cast<Eigen::Index>(order);
    MatrixXd psi(n, n);
    for (Eigen::Index i = 0; i < n; i++) psi.row(i) = exponential(A, -shift[i] * T_s).row(0);
    MatrixXd right(n, static_cast<Eigen::Index>(derivatives) + 1);
    VectorXd c = VectorXd::Unit(n, 0);
    for (Eigen::Index j = 0; j < right.cols(); j++, c = (A.transpose() * c).eval()) right.col(j) = -c;
    const auto x = solve(psi.transpose(), right);
    if (!x) return DRIVEID_RANK;
    Eigen::Map<MatrixXd>(p, n, right.cols()) = *x;
    return DRIVEID_OK;
}

driveid_status driveid_modal_prefilter(size_t modes, const double *A_c, const double *c_c, double T_s, const int32_t *shift, double *l) {
    if (!A_c || !c_c || !shift || !l || modes < 1 || modes > 4 * order_max || !(T_s > 0)) return DRIVEID_ERR_ARGUMENT;
    const auto n = static_cast<Eigen::Index>(modes);
    const MatrixXd A = Eigen::Map<const RowMajor>(A_c, n, n);
    const Eigen::Map<const VectorXd> c(c_c, n);
    MatrixXd psi(n, n);
    for (Eigen::Index i = 0; i < n; i++) psi.row(i) = c.transpose() * exponential(A, -shift[i] * T_s);
    const auto x = solve(psi.transpose(), -c);
    if (!x) return DRIVEID_RANK;
    Eigen::Map<VectorXd>(l, n) = x->col(0);
    return DRIVEID_OK;
}
