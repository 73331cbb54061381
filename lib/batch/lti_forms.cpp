// SPDX-License-Identifier: Apache-2.0
// What an identified transfer function means: poles, zeros, damping with intervals, Bode data, forms in s, z and q.
#include "batch/lti_filter.hpp"

#include <algorithm>
#include <cmath>
#include <complex>

using namespace driveid::lti;
using driveid::modal::companion;
using Complex = std::complex<double>;

namespace {

// Roots of sum c_k x^k, highest coefficient not zero, by magnitude, positive imaginary part first.
std::vector<Complex> roots(std::vector<double> c) {
    while (c.size() > 1 && c.back() == 0) c.pop_back();
    const std::size_t n = c.size() - 1;
    if (n == 0) return {};
    for (std::size_t k = 0; k < n; k++) c[k] /= c[n];
    const Eigen::VectorXcd e = driveid::modal::eigenvalues(companion(n, c.data()));
    std::vector<Complex> r(e.begin(), e.end());
    std::sort(r.begin(), r.end(), [](Complex a, Complex b) {
        if (std::abs(std::abs(a) - std::abs(b)) > 1e-12 * (std::abs(a) + std::abs(b))) return std::abs(a) < std::abs(b);
        return a.imag() > b.imag();
    });
    return r;
}

Complex polynomial(const double *c, std::size_t count, Complex s) {
    Complex sum = 0;
    for (std::size_t k = count; k-- > 0;) sum = sum * s + c[k];
    return sum;
}

bool valid(const driveid_lti_model *m) { return m && m->order >= 1 && m->order <= DRIVEID_LTI_ORDER_MAX && m->zeros < m->order; }

} // namespace

driveid_status driveid_lti_modes_of(const driveid_lti_model *model, driveid_lti_modes *modes) {
    if (!valid(model) || !modes) return DRIVEID_ERR_ARGUMENT;
    if (model->a[0] == 0) return DRIVEID_ERR_NUMERIC;
    const std::size_t n = model->order, k = n + model->zeros + 1;
    std::vector<double> A(model->a, model->a + n), B(model->b, model->b + model->zeros + 1);
    A.push_back(1);
    const Eigen::Map<const driveid::modal::RowMajor> cov(model->cov, static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(k));
    *modes = {};
    const auto pole = roots(A), zero = roots(B);
    modes->poles = pole.size();
    modes->zeros = zero.size();
    for (std::size_t p = 0; p < pole.size(); p++) {
        const Complex s = pole[p];
        Complex slope = 0;
        for (std::size_t j = n; j >= 1; j--) slope = slope * s + static_cast<double>(j) * A[j];
        // ds/da_i = -s^i / A'(s); omega = |s|, zeta = -Re s / |s|.
        VectorXd d_omega = VectorXd::Zero(static_cast<Eigen::Index>(k)), d_zeta = d_omega;
        const double w = std::abs(s);
        Complex power = 1;
        for (std::size_t i = 0; i < n; i++, power *= s) {
            const Complex ds = std::abs(slope) > 0 ? -power / slope : Complex(0);
            const double dw = w > 0 ? (s.real() * ds.real() + s.imag() * ds.imag()) / w : 0;
            d_omega(static_cast<Eigen::Index>(i)) = dw;
            d_zeta(static_cast<Eigen::Index>(i)) = w > 0 ? -ds.real() / w + s.real() * dw / (w * w) : 0;
        }
        modes->pole_re[p] = s.real();
        modes->pole_im[p] = s.imag();
        modes->omega_rad_s[p] = w;
        modes->zeta[p] = w > 0 ? -s.real() / w : 0;
        modes->omega_half[p] = 1.96 * std::sqrt(std::max(0.0, d_omega.dot(cov * d_omega)));
        modes->zeta_half[p] = 1.96 * std::sqrt(std::max(0.0, d_zeta.dot(cov * d_zeta)));
    }
    for (std::size_t z = 0; z < zero.size(); z++) {
        modes->zero_re[z] = zero[z].real();
        modes->zero_im[z] = zero[z].imag();
    }
    VectorXd d = VectorXd::Zero(static_cast<Eigen::Index>(k));
    d(0) = -model->b[0] / (model->a[0] * model->a[0]);
    d(static_cast<Eigen::Index>(n)) = 1 / model->a[0];
    modes->gain = model->b[0] / model->a[0];
    modes->gain_half = 1.96 * std::sqrt(std::max(0.0, d.dot(cov * d)));
    return DRIVEID_OK;
}

driveid_status driveid_lti_frequency(const driveid_lti_model *model, size_t count, const double *omega, double *re, double *im) {
    if (!valid(model) || !omega || !re || !im) return DRIVEID_ERR_ARGUMENT;
    std::vector<double> A(model->a, model->a + model->order);
    A.push_back(1);
    for (size_t k = 0; k < count; k++) {
        const Complex s(0, omega[k]);
        const Complex H = polynomial(model->b, model->zeros + 1, s) / polynomial(A.data(), A.size(), s) * std::exp(-s * (static_cast<double>(model->delay) * model->T_s));
        re[k] = H.real();
        im[k] = H.imag();
    }
    return DRIVEID_OK;
}

driveid_status driveid_lti_to_z(const driveid_lti_model *model, double T_s, double *az, double *bz) {
    if (!valid(model) || !az || !bz || !(T_s > 0)) return DRIVEID_ERR_ARGUMENT;
    const auto n = static_cast<Eigen::Index>(model->order);
    MatrixXd block = MatrixXd::Zero(n + 1, n + 1);
    block.topLeftCorner(n, n) = companion(model->order, model->a) * T_s;
    block(n - 1, n) = T_s;
    const MatrixXd e = driveid::modal::exponential(block, 1);
    const MatrixXd Phi = e.topLeftCorner(n, n);
    VectorXd x = e.topRightCorner(n, 1);
    Eigen::RowVectorXd c = Eigen::RowVectorXd::Zero(n);
    for (size_t j = 0; j <= model->zeros; j++) c(static_cast<Eigen::Index>(j)) = model->b[j];
    const VectorXd a = driveid::modal::characteristic(Phi);
    // Markov parameters h_k = c Phi^(k-1) G give the numerator: b_(n-k) = h_k + sum a_(n-i) h_(k-i).
    std::vector<double> h;
    for (Eigen::Index k = 1; k <= n; k++, x = (Phi * x).eval()) {
        h.push_back(c * x);
        double b = h.back();
        for (Eigen::Index i = 1; i < k; i++) b += a(n - i) * h[static_cast<size_t>(k - i - 1)];
        bz[n - k] = b;
    }
    Eigen::Map<VectorXd>(az, n) = a;
    return DRIVEID_OK;
}

driveid_status driveid_lti_from_z(size_t order, const double *az, const double *bz, double T_s, driveid_lti_model *model) {
    if (!az || !bz || !model || order < 1 || order > DRIVEID_LTI_ORDER_MAX || !(T_s > 0)) return DRIVEID_ERR_ARGUMENT;
    const auto n = static_cast<Eigen::Index>(order);
    std::vector<double> A(az, az + order);
    A.push_back(1);
    for (const Complex z : roots(A))
        if (std::abs(z) < 1e-12 || (std::abs(z.imag()) < 1e-12 && z.real() < 0)) return DRIVEID_ERR_NUMERIC;
    // Observer form: Phi = companion', c = e_n', G = numerator; the logarithm of the block [Phi G; 0 1] is [A B; 0 0] T.
    MatrixXd block = MatrixXd::Zero(n + 1, n + 1);
    block.topLeftCorner(n, n) = companion(order, az).transpose();
    for (Eigen::Index i = 0; i < n; i++) block(i, n) = bz[i];
    block(n, n) = 1;
    const MatrixXd log_block = driveid::modal::logarithm(block) / T_s;
    if (!log_block.allFinite()) return DRIVEID_ERR_NUMERIC;
    const MatrixXd Ac = log_block.topLeftCorner(n, n);
    VectorXd x = log_block.topRightCorner(n, 1);
    const VectorXd a = driveid::modal::characteristic(Ac);
    *model = {};
    model->order = order;
    model->zeros = order - 1;
    model->T_s = T_s;
    std::vector<double> h;
    for (Eigen::Index k = 1; k <= n; k++, x = (Ac * x).eval()) {
        h.push_back(x(n - 1));
        double b = h.back();
        for (Eigen::Index i = 1; i < k; i++) b += a(n - i) * h[static_cast<size_t>(k - i - 1)];
        model->b[n - k] = b;
    }
    Eigen::Map<VectorXd>(model->a, n) = a;
    return DRIVEID_OK;
}

driveid_status driveid_lti_z_to_q(size_t order, const double *az, const double *bz, double T_s, double *Aq, double *Bq) {
    if (!az || !bz || !Aq || !Bq || order < 1 || order > DRIVEID_LTI_ORDER_MAX || !(T_s > 0)) return DRIVEID_ERR_ARGUMENT;
    // z = (1 + q/W)/(1 - q/W): sum c_i (1 + q/W)^i (1 - q/W)^(n-i).
    const double W = 2 / T_s;
    const auto mapped = [&](const std::vector<double> &c) {
        std::vector<double> out(order + 1, 0.0);
        for (size_t i = 0; i < c.size(); i++) {
            std::vector<double> p{c[i]};
            for (size_t k = 0; k < order; k++) {
                const double slope = (k < i ? 1 : -1) / W;
                p.push_back(0);
                for (size_t j = p.size() - 1; j > 0; j--) p[j] += slope * p[j - 1];
            }
            for (size_t j = 0; j <= order; j++) out[j] += p[j];
        }
        return out;
    };
    std::vector<double> A(az, az + order), B(bz, bz + order);
    A.push_back(1);
    const auto a = mapped(A), b = mapped(B);
    if (a[0] == 0) return DRIVEID_ERR_NUMERIC;
    for (size_t j = 1; j <= order; j++) Aq[j - 1] = a[j] / a[0];
    for (size_t j = 0; j <= order; j++) Bq[j] = b[j] / a[0];
    return DRIVEID_OK;
}
