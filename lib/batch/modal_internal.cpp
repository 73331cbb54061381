// SPDX-License-Identifier: Apache-2.0
#include "batch/modal_internal.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>

#include <algorithm>
#include <cmath>

namespace driveid::modal {

VectorXd quadrature_weights(std::size_t intervals, double T_s, driveid_quadrature rule) {
    const auto n = static_cast<Eigen::Index>(intervals);
    VectorXd w = VectorXd::Zero(n + 1);
    if (rule == DRIVEID_QUADRATURE_SIMPSON) {
        if (intervals % 2) return {};
        for (Eigen::Index k = 0; k < n; k += 2) w.segment(k, 3) += T_s / 3 * Eigen::Vector3d(1, 4, 1);
    } else if (rule == DRIVEID_QUADRATURE_BOOLE) {
        if (intervals % 4) return {};
        Eigen::Matrix<double, 5, 1> boole;
        boole << 7, 32, 12, 32, 7;
        for (Eigen::Index k = 0; k < n; k += 4) w.segment(k, 5) += 2 * T_s / 45 * boole;
    } else {
        for (Eigen::Index k = 0; k < n; k++) w.segment(k, 2) += T_s / 2 * Eigen::Vector2d(1, 1);
    }
    return w;
}

std::optional<MatrixXd> solve(const MatrixXd &A, const MatrixXd &B) {
    const VectorXd length = A.colwise().norm().transpose();
    if (A.rows() < A.cols() || (length.array() <= 0).any() || !A.allFinite() || !B.allFinite()) return std::nullopt;
    const MatrixXd scaled = A * length.cwiseInverse().asDiagonal();
    Eigen::ColPivHouseholderQR<MatrixXd> qr(scaled);
    qr.setThreshold(1e-13);
    if (qr.rank() < A.cols()) return std::nullopt;
    return length.cwiseInverse().asDiagonal() * qr.solve(B);
}

MatrixXd companion(std::size_t order, const double *a) {
    const auto n = static_cast<Eigen::Index>(order);
    MatrixXd A = MatrixXd::Zero(n, n);
    A.topRightCorner(n - 1, n - 1).setIdentity();
    for (Eigen::Index j = 0; j < n; j++) A(n - 1, j) = -a[j];
    return A;
}

// Scaling and squaring with the (8, 8) Pade form, exact to rounding for norms below one half.
MatrixXd exponential(const MatrixXd &A, double t_s) {
    const double norm = A.cwiseAbs().rowwise().sum().maxCoeff() * std::abs(t_s);
    const int squarings = norm > 0.5 ? static_cast<int>(std::ceil(std::log2(norm / 0.5))) : 0;
    const MatrixXd X = A * (t_s / std::pow(2.0, squarings));
    MatrixXd power = MatrixXd::Identity(A.rows(), A.cols()), N = power, D = power;
    double c = 1;
    for (int k = 1; k <= 8; k++) {
        c *= (8.0 - k + 1) / (k * (16.0 - k + 1));
        power = (power * X).eval();
        N += c * power;
        D += (k % 2 ? -c : c) * power;
    }
    MatrixXd out = inverse(D) * N;
    for (int k = 0; k < squarings; k++) out = (out * out).eval();
    return out;
}

// Inverse scaling and squaring: square roots by the product form of Denman and Beavers until A is near the identity, then
// log A = 2 artanh((A - I)(A + I)^-1). Eigen's own logarithm costs the compiler a minute.
MatrixXd logarithm(const MatrixXd &A) {
    const MatrixXd I = MatrixXd::Identity(A.rows(), A.cols());
    MatrixXd root = A;
    double scale = 2;
    while ((root - I).norm() > 0.05 && scale < 1e12) {
        MatrixXd Y = root, Z = I;
        for (int k = 0; k < 50; k++) {
            const MatrixXd next = (Y + inverse(Z)) / 2;
            Z = (Z + inverse(Y)) / 2;
            const double change = (next - Y).norm();
            Y = next;
            if (!(change > 1e-15 * Y.norm())) break;
        }
        root = Y;
        scale *= 2;
    }
    const MatrixXd x = (root - I) * inverse(root + I), square = x * x;
    MatrixXd sum = MatrixXd::Zero(A.rows(), A.cols()), power = x;
    for (int k = 0; k < 12; k++, power = (power * square).eval()) sum += power / (2 * k + 1);
    return scale * sum;
}

Eigen::VectorXcd eigenvalues(const MatrixXd &A) { return Eigen::EigenSolver<MatrixXd>(A, false).eigenvalues(); }

using SquareSvd = Eigen::JacobiSVD<MatrixXd, Eigen::NoQRPreconditioner>;

VectorXd singular_values(const MatrixXd &A) { return SquareSvd(triangle(A), Eigen::ComputeFullV).singularValues(); }

VectorXd last_right_singular_vector(const MatrixXd &A) { return SquareSvd(triangle(A), Eigen::ComputeFullV).matrixV().rightCols(1); }

MatrixXd orthonormal_columns(const MatrixXd &A) { return A.householderQr().householderQ() * MatrixXd::Identity(A.rows(), A.cols()); }

MatrixXd triangle(const MatrixXd &A) { return A.householderQr().matrixQR().topRows(A.cols()).triangularView<Eigen::Upper>(); }

MatrixXd inverse(const MatrixXd &A) { return A.partialPivLu().inverse(); }

VectorXd characteristic(const MatrixXd &A) {
    const Eigen::Index n = A.rows();
    VectorXd a = VectorXd::Zero(n + 1), trace = VectorXd::Zero(n + 1);
    a(n) = 1;
    MatrixXd power = A;
    for (Eigen::Index k = 1; k <= n; k++, power = (power * A).eval()) {
        trace(k) = power.trace();
        double sum = trace(k);
        for (Eigen::Index i = 1; i < k; i++) sum += a(n - k + i) * trace(i);
        a(n - k) = -sum / static_cast<double>(k);
    }
    return a.head(n);
}

bool fits(const driveid_modal_task &task, std::int64_t extra) {
    if (!task.y || !task.shift || !task.first || !task.last || !task.windows || task.order < 1 || task.order > order_max) return false;
    if (task.modes && !task.mode) return false;
    if (!(task.T_s > 0)) return false;
    for (std::size_t w = 0; w < task.windows; w++) {
        if (task.last[w] <= task.first[w] || task.last[w] >= task.rows) return false;
        for (std::size_t i = 0; i < task.order; i++) {
            const std::int64_t shift = task.shift[i];
            const auto low = static_cast<std::int64_t>(task.first[w]) - shift + std::min<std::int64_t>(extra, 0);
            const auto high = static_cast<std::int64_t>(task.last[w]) - shift + std::max<std::int64_t>(extra, 0);
            if (low < 0 || high >= static_cast<std::int64_t>(task.rows)) return false;
        }
    }
    return true;
}

} // namespace driveid::modal
