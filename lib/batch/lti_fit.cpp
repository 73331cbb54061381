// SPDX-License-Identifier: Apache-2.0
// LS, TLS, IV, SRIVC and output error for continuous-time transfer functions.
#include "batch/lti_filter.hpp"

#include <algorithm>
#include <cmath>
#include <complex>

namespace driveid::lti {
namespace {

struct Data {
    VectorXd y, u;
    double T_s;
    Eigen::Index n, m;  // order, degree of B
    bool zero_order_hold, initial;
    Eigen::Index unknowns() const { return n + m + 1 + (initial ? n : 0); }
};

struct Regression {
    MatrixXd Phi;  // [-D^0..D^(n-1) y_f, D^0..D^m u_f, impulses]
    VectorXd top;  // D^n y_f
};

// between: what the straight lines between the samples of output miss of its filtered derivatives.
Regression regression(const Data &d, const VectorXd &output, const VectorXd &f, const MatrixXd *between = nullptr) {
    MatrixXd y_f = filtered(output, f, d.T_s, false);
    const MatrixXd u_f = filtered(d.u, f, d.T_s, d.zero_order_hold);
    if (between) y_f += *between;
    Regression r{MatrixXd(d.y.size(), d.unknowns()), highest(output, y_f, f)};
    r.Phi << -y_f, u_f.leftCols(d.m + 1), d.initial ? impulses(f, d.T_s, d.y.size()) : MatrixXd(d.y.size(), 0);
    return r;
}

// Mirror unstable or marginal roots to the left half plane: a filter must decay.
VectorXd stabilised(const VectorXd &a, double slowest) {
    const Eigen::Index n = a.size();
    const Eigen::VectorXcd root = modal::eigenvalues(modal::companion(static_cast<std::size_t>(n), a.data()));
    Eigen::VectorXcd polynomial = Eigen::VectorXcd::Zero(n + 1);
    polynomial(0) = 1;
    for (Eigen::Index k = 0; k < n; k++) {
        const std::complex<double> s(-std::max(std::abs(root(k).real()), slowest), root(k).imag());
        for (Eigen::Index j = k + 1; j > 0; j--) polynomial(j) = polynomial(j - 1) - s * polynomial(j);
        polynomial(0) *= -s;
    }
    return polynomial.head(n).real();
}

VectorXd simulated(const Data &d, const VectorXd &theta) {
    const VectorXd a = theta.head(d.n);
    VectorXd out = filtered(d.u, a, d.T_s, d.zero_order_hold).leftCols(d.m + 1) * theta.segment(d.n, d.m + 1);
    if (d.initial) out += impulses(a, d.T_s, d.y.size()) * theta.tail(d.n);
    return out;
}

// A model knows how its output runs between the samples: its exactly filtered derivatives less those along straight lines.
MatrixXd between_samples(const Data &d, const VectorXd &stable, const VectorXd &f) {
    const VectorXd c = d.initial ? VectorXd(stable.tail(d.n)) : VectorXd();
    return cascaded(d.u, stable.head(d.n), stable.segment(d.n, d.m + 1), c, f, d.T_s, d.zero_order_hold) - filtered(simulated(d, stable), f, d.T_s, false);
}

double bandwidth(const Data &d) {
    // Frequency below which 90 % of the energy of the output's increments lies, from their first two moments.
    const Eigen::Index N = d.y.size();
    const VectorXd centred = d.y.array() - d.y.mean(), step = d.y.tail(N - 1) - d.y.head(N - 1);
    const double w = std::sqrt(step.squaredNorm() / std::max(centred.squaredNorm(), 1e-300)) / d.T_s;
    return std::clamp(3 * w, 20 / (static_cast<double>(N) * d.T_s), 0.7 / d.T_s);
}

VectorXd binomial_filter(Eigen::Index n, double lambda) {
    VectorXd f = VectorXd::Zero(n + 1);
    f(0) = 1;
    for (Eigen::Index k = 0; k < n; k++)
        for (Eigen::Index j = k + 1; j >= 0; j--) f(j) = (j ? f(j - 1) : 0) + lambda * f(j);
    return f.head(n);
}

std::optional<VectorXd> least_squares(const Regression &r) {
    const auto x = modal::solve(r.Phi, r.top);
    if (!x) return std::nullopt;
    return VectorXd(x->col(0));
}

// Triangle of the covariance, summed over the rows, that white noise of unit variance on y gives to [-D^0..D^(n-1) y_f, D^n y_f].
MatrixXd noise_triangle(const Data &d, const VectorXd &f) {
    VectorXd impulse = VectorXd::Zero(d.y.size());
    impulse(1) = 1;
    MatrixXd response(d.y.size(), d.n + 1);
    const MatrixXd h = filtered(impulse, f, d.T_s, false);
    response << -h, highest(impulse, h, f);
    return modal::triangle(response) * std::sqrt(static_cast<double>(d.y.size()));
}

// Total least squares on the columns that carry noise, each weighed with its noise; those of u and of the initial conditions are exact.
std::optional<VectorXd> total_least_squares(const Data &d, const Regression &r, const MatrixXd &noise) {
    const Eigen::Index exact = r.Phi.cols() - d.n, noisy = d.n + 1;
    MatrixXd all(r.Phi.rows(), r.Phi.cols() + 1);
    all << r.Phi.rightCols(exact), r.Phi.leftCols(d.n), r.top;
    // Reduce to the triangle first: the SVD then costs nothing in the number of rows.
    const VectorXd scale = all.colwise().norm().transpose();
    if ((scale.array() <= 0).any()) return std::nullopt;
    const MatrixXd R = modal::triangle(all * scale.cwiseInverse().asDiagonal()) * scale.asDiagonal();
    const MatrixXd unweigh = modal::inverse(noise);
    const VectorXd v = unweigh * modal::last_right_singular_vector(R.bottomRightCorner(noisy, noisy) * unweigh);
    if (!(std::abs(v(d.n)) > 1e-300)) return std::nullopt;
    VectorXd theta(r.Phi.cols());
    theta.head(d.n) = -v.head(d.n) / v(d.n);
    VectorXd weights(noisy);
    weights << -theta.head(d.n), 1;
    const auto rest = modal::solve(R.topLeftCorner(exact, exact), R.topRightCorner(exact, noisy) * weights);
    if (!rest) return std::nullopt;
    theta.tail(exact) = rest->col(0);
    return theta;
}

std::optional<VectorXd> instrumental(const Regression &r, const MatrixXd &Z) {
    const VectorXd scale = Z.colwise().norm().transpose();
    if ((scale.array() <= 0).any()) return std::nullopt;
    const MatrixXd Q = modal::orthonormal_columns(Z * scale.cwiseInverse().asDiagonal());
    const auto x = modal::solve(Q.transpose() * r.Phi, Q.transpose() * r.top);
    if (!x) return std::nullopt;
    return VectorXd(x->col(0));
}

// Sandwich S^-1 Z' Omega Z S^-T, S the slope of the equation Z'residual = 0, with a Bartlett window on the scores' autocorrelation.
MatrixXd sandwich(const MatrixXd &slope, const MatrixXd &Z, const VectorXd &residual) {
    const Eigen::Index N = Z.rows(), lags = std::min<Eigen::Index>(N / 5, static_cast<Eigen::Index>(4 * std::pow(N / 100.0, 0.25) * 10));
    const MatrixXd score = Z.array().colwise() * residual.array();
    MatrixXd middle = score.transpose() * score;
    for (Eigen::Index l = 1; l <= lags; l++) {
        const MatrixXd cross = score.topRows(N - l).transpose() * score.bottomRows(N - l);
        middle += (1.0 - static_cast<double>(l) / static_cast<double>(lags + 1)) * (cross + cross.transpose());
    }
    // The scores sum to zero, so the window sees 1 - w + w^2/3 of their spread, w its share of the record; and the fit took its unknowns.
    const double w = static_cast<double>(lags + 1) / static_cast<double>(N), seen = (1 - w + w * w / 3) * (1 - static_cast<double>(Z.cols()) / static_cast<double>(N));
    const MatrixXd bread = modal::inverse(slope);
    return bread * middle * bread.transpose() / seen;
}

// sigma^2 (Z'Z)^-1 through the triangle of Z.
MatrixXd efficient(const MatrixXd &Z, double sigma) {
    const VectorXd scale = Z.colwise().norm().transpose().cwiseInverse();
    const MatrixXd factor = scale.asDiagonal() * modal::inverse(modal::triangle(Z * scale.asDiagonal()));
    return sigma * sigma * factor * factor.transpose();
}

struct Fit {
    VectorXd theta;
    MatrixXd cov;
    std::size_t iterations = 0;
    bool converged = false;
};

VectorXd stable_of(const Data &d, const VectorXd &theta) {
    VectorXd stable = theta;
    stable.head(d.n) = stabilised(theta.head(d.n), 0.5 / (static_cast<double>(d.y.size()) * d.T_s));
    return stable;
}

// Largest change relative to the coefficient; one that is near zero beside the others, at the frequency w of the fastest root, to a tenth of those.
double change_of(const Data &d, const VectorXd &next, const VectorXd &theta) {
    double w = 1e-300, gain = 0, worst = 0;
    for (Eigen::Index i = 0; i < d.n; i++) w = std::max(w, std::pow(std::abs(next(i)), 1.0 / static_cast<double>(d.n - i)));
    for (Eigen::Index j = 0; j <= d.m; j++) gain = std::max(gain, std::abs(next(d.n + j)) * std::pow(w, j));
    for (Eigen::Index i = 0; i < d.n + d.m + 1; i++) {
        const double others = i < d.n ? std::pow(w, d.n - i) : gain / std::pow(w, i - d.n);
        worst = std::max(worst, std::abs(next(i) - theta(i)) / (std::max(std::abs(next(i)), 0.1 * others) + 1e-300));
    }
    return worst;
}

// Total least squares sets sum (phi - g e) e to zero, g = cov(phi, e)/var(e); the noise's share leaves the slope.
MatrixXd total_covariance(const Data &d, const Regression &r, const MatrixXd &noise, const VectorXd &theta) {
    VectorXd weights(d.n + 1);
    weights << -theta.head(d.n), 1;
    const VectorXd e = r.top - r.Phi * theta, common = noise.transpose() * (noise * weights);
    const double share = weights.dot(common), variance = e.squaredNorm() / share;
    MatrixXd Z = r.Phi, slope = r.Phi.transpose() * r.Phi;
    Z.leftCols(d.n) -= e * (common.head(d.n) / share).transpose();
    slope.topLeftCorner(d.n, d.n) -= variance * (noise.transpose() * noise).topLeftCorner(d.n, d.n);
    return sandwich(slope, Z, e);
}

// LS, TLS and IV on one filter. Each round hands the model of the last to between_samples: without noise the last round is exact.
std::optional<Fit> on_one_filter(const Data &d, driveid_lti_method method, const VectorXd &f) {
    const MatrixXd noise = noise_triangle(d, f);
    Fit fit;
    Regression r = regression(d, d.y, f);
    MatrixXd Z;
    for (fit.iterations = 1; fit.iterations <= 30; fit.iterations++) {
        auto next = method == DRIVEID_LTI_TLS ? total_least_squares(d, r, noise) : least_squares(r);
        if (next && method == DRIVEID_LTI_IV) {
            Z = regression(d, simulated(d, stable_of(d, fit.theta.size() ? fit.theta : *next)), f).Phi;
            next = instrumental(r, Z);
        }
        if (!next || !next->allFinite()) return std::nullopt;
        fit.converged = fit.theta.size() && change_of(d, *next, fit.theta) < 1e-9;
        fit.theta = *next;
        if (fit.converged) break;
        const MatrixXd between = between_samples(d, stable_of(d, fit.theta), f);
        r = regression(d, d.y, f, &between);
    }
    const VectorXd e = r.top - r.Phi * fit.theta;
    if (method == DRIVEID_LTI_TLS) fit.cov = total_covariance(d, r, noise, fit.theta);
    else if (method == DRIVEID_LTI_IV) fit.cov = sandwich(Z.transpose() * r.Phi, Z, e);
    else {
        fit.cov = sandwich(r.Phi.transpose() * r.Phi, r.Phi, e);
        const auto unbiased = total_least_squares(d, r, noise);
        if (unbiased) fit.cov += (*unbiased - fit.theta) * (*unbiased - fit.theta).transpose();
    }
    return fit;
}

std::optional<Fit> refined(const Data &d, VectorXd theta) {
    Fit fit;
    for (fit.iterations = 1; fit.iterations <= 50; fit.iterations++) {
        const VectorXd stable = stable_of(d, theta), f = stable.head(d.n);
        const MatrixXd between = between_samples(d, stable, f);
        const Regression r = regression(d, d.y, f, &between);
        const MatrixXd Z = regression(d, simulated(d, stable), f).Phi;
        const auto next = instrumental(r, Z);
        if (!next) return std::nullopt;
        const double change = change_of(d, *next, theta);
        theta = *next;
        if (change < 1e-8) {
            fit.converged = true;
            break;
        }
    }
    fit.theta = theta;
    return fit;
}

// Sensitivities of the simulated output are the filtered noise-free regressors themselves: dx/da_i = -D^i x/A, dx/db_j = D^j u/A.
std::optional<Fit> output_error(const Data &d, VectorXd theta) {
    Fit fit;
    double cost = (d.y - simulated(d, theta)).squaredNorm();
    for (fit.iterations = 1; fit.iterations <= 50; fit.iterations++) {
        const VectorXd x = simulated(d, theta);
        const MatrixXd Z = regression(d, x, theta.head(d.n)).Phi;
        const auto step = modal::solve(Z, d.y - x);
        if (!step) return std::nullopt;
        double length = 1;
        VectorXd next = theta;
        double better = cost;
        for (; length > 1e-4; length /= 2) {
            next = theta + length * step->col(0);
            better = (d.y - simulated(d, next)).squaredNorm();
            if (std::isfinite(better) && better <= cost) break;
        }
        if (!(better <= cost)) {
            fit.converged = change_of(d, theta + step->col(0), theta) < 1e-6; // at the least cost but for rounding
            break;
        }
        const double change = change_of(d, next, theta);
        const double gained = (cost - better) / std::max(cost, 1e-300);
        theta = next;
        cost = better;
        if (change < 1e-8 || gained < 1e-12) {
            fit.converged = true;
            break;
        }
    }
    fit.theta = theta;
    return fit;
}

std::optional<Fit> estimate(const Data &d, const driveid_lti_task &task) {
    const double lambda = task.bandwidth_rad_s > 0 ? task.bandwidth_rad_s : bandwidth(d);
    const VectorXd f = binomial_filter(d.n, lambda);
    if (task.method == DRIVEID_LTI_LS || task.method == DRIVEID_LTI_TLS || task.method == DRIVEID_LTI_IV) return on_one_filter(d, task.method, f);
    const auto start = least_squares(regression(d, d.y, f));
    if (!start) return std::nullopt;
    auto best = refined(d, *start);
    if (!best) return std::nullopt;
    if (task.method == DRIVEID_LTI_OE) {
        const std::size_t before = best->iterations;
        best = output_error(d, best->theta);
        if (!best) return std::nullopt;
        best->iterations += before;
    }
    const VectorXd x = simulated(d, best->theta);
    const double freedom = static_cast<double>(d.y.size() - d.unknowns());
    best->cov = efficient(regression(d, x, best->theta.head(d.n)).Phi, std::sqrt((d.y - x).squaredNorm() / freedom));
    return best;
}

} // namespace
} // namespace driveid::lti

using namespace driveid::lti;

driveid_status driveid_lti_fit(const driveid_lti_task *task, driveid_lti_model *model) {
    if (!task || !model || !task->y || !task->u || !(task->T_s > 0)) return DRIVEID_ERR_ARGUMENT;
    if (task->order < 1 || task->order > DRIVEID_LTI_ORDER_MAX || task->zeros >= task->order) return DRIVEID_ERR_ARGUMENT;
    const auto N = static_cast<Eigen::Index>(task->rows);
    const Eigen::Map<const VectorXd> y(task->y, N), u(task->u, N);
    Data d{y, {}, task->T_s, static_cast<Eigen::Index>(task->order), static_cast<Eigen::Index>(task->zeros), task->hold == DRIVEID_HOLD_ZERO, task->initial_conditions != 0};
    if (N < 10 * d.unknowns() || task->delay * 2 > task->rows || !y.allFinite() || !u.allFinite()) return DRIVEID_ERR_DATA;
    if (y.maxCoeff() == y.minCoeff() || u.maxCoeff() == u.minCoeff()) return DRIVEID_ERR_DATA;
    d.u = delayed(u, task->delay, d.initial ? u(0) : 0); // from rest: no input before the record
    const auto fit = estimate(d, *task);
    if (!fit || !fit->theta.allFinite() || !fit->cov.allFinite()) return DRIVEID_RANK;

    const Eigen::Index k = d.n + d.m + 1;
    *model = {};
    model->order = task->order;
    model->zeros = task->zeros;
    model->delay = task->delay;
    model->T_s = task->T_s;
    std::copy(fit->theta.data(), fit->theta.data() + d.n, model->a);
    std::copy(fit->theta.data() + d.n, fit->theta.data() + k, model->b);
    Eigen::Map<driveid::modal::RowMajor>(model->cov, k, k) = fit->cov.topLeftCorner(k, k);
    model->iterations = fit->iterations;
    model->converged = fit->converged;
    const VectorXd error = d.y - simulated(d, fit->theta);
    const double mse = error.squaredNorm() / static_cast<double>(N);
    model->noise_sd = std::sqrt(error.squaredNorm() / static_cast<double>(N - d.unknowns()));
    model->fit_percent = std::isfinite(mse) ? 100 * (1 - error.norm() / (d.y.array() - d.y.mean()).matrix().norm()) : -1e9;
    model->bic = std::isfinite(mse) ? static_cast<double>(N) * std::log(std::max(mse, 1e-300)) + static_cast<double>(d.unknowns() + (task->delay > 0)) * std::log(static_cast<double>(N)) : 1e300;
    return DRIVEID_OK;
}

driveid_status driveid_lti_search(const driveid_lti_task *task, size_t delay_max, driveid_lti_model *best) {
    if (!task || !best || task->order < 1 || task->order > DRIVEID_LTI_ORDER_MAX) return DRIVEID_ERR_ARGUMENT;
    driveid_status status = DRIVEID_RANK;
    bool any = false;
    for (size_t order = 1; order <= task->order; order++)
        for (size_t zeros = 0; zeros < order && zeros <= task->zeros; zeros++)
            for (size_t delay = 0; delay <= delay_max; delay++) {
                driveid_lti_task t = *task;
                t.order = order;
                t.zeros = zeros;
                t.delay = delay;
                driveid_lti_model model;
                status = driveid_lti_fit(&t, &model);
                if (status < 0) return status;
                if (status != DRIVEID_OK) continue;
                const size_t size = model.order + model.zeros, best_size = any ? best->order + best->zeros : 0;
                if (!any || model.bic < best->bic - (size > best_size ? 10 : 0)) {
                    *best = model;
                    any = true;
                }
            }
    return any ? DRIVEID_OK : status;
}
