// SPDX-License-Identifier: Apache-2.0
#include "calibrate.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "effects.hpp"

namespace sim {
namespace {

constexpr int COLUMNS = 5;
using Row = std::array<double, COLUMNS + 1>;  // regressors, then the left side

// Weights of a smooth bump (1 - s^2)^4 and its first two derivatives over a half-width of `half` samples, so that sums over samples are integrals.
struct Window {
    int half;
    std::vector<double> k, k1, k2;
    Window(double dt, double half_s, double shift) : half(std::max(6, static_cast<int>(std::lround(half_s / dt)))) {
        const double H = half * dt;
        double area = 0;
        for (int j = -half; j <= half; ++j) {
            const double s = (j + shift) * dt / H, u = std::max(1 - s * s, 0.0);
            k.push_back(u * u * u * u);
            k1.push_back(-8 * s * u * u * u / H);
            k2.push_back((-8 * u * u * u + 48 * s * s * u * u) / (H * H));
            area += k.back();
        }
        for (auto *w : {&k, &k1, &k2}) for (double &x : *w) x /= area;
    }
};

template <class Get>
double window_sum(const std::vector<double> &w, int half, std::size_t centre, Get get) {
    double sum = 0;
    for (int j = -half; j <= half; ++j) sum += w[static_cast<std::size_t>(j + half)] * get(centre + static_cast<std::size_t>(j));
    return sum;
}

// RMS of the least-squares residual of the last entry on the chosen columns; t: statistic of the last chosen column.
double residual_rms(const std::vector<Row> &rows, const std::vector<int> &columns, double *t) {
    const int n = static_cast<int>(columns.size());
    double A[COLUMNS][COLUMNS + 1] = {}, scale[COLUMNS];
    for (int a = 0; a < n; ++a) {
        double s = 0;
        for (const auto &r : rows) s += r[columns[a]] * r[columns[a]];
        scale[a] = s > 0 ? 1 / std::sqrt(s) : 0;
    }
    for (const auto &r : rows)
        for (int a = 0; a < n; ++a) {
            for (int b = 0; b < n; ++b) A[a][b] += r[columns[a]] * scale[a] * r[columns[b]] * scale[b];
            A[a][n] += r[columns[a]] * scale[a] * r[COLUMNS];
        }
    double pivot_last = 0;
    for (int a = 0; a < n; ++a) {  // elimination without exchange: positive definite after scaling, ridge for empty columns
        A[a][a] += 1e-12;
        if (a == n - 1) pivot_last = A[a][a];
        for (int b = a + 1; b < n; ++b) {
            const double f = A[b][a] / A[a][a];
            for (int c = a; c <= n; ++c) A[b][c] -= f * A[a][c];
        }
    }
    double x[COLUMNS] = {};
    for (int a = n - 1; a >= 0; --a) {
        double s = A[a][n];
        for (int b = a + 1; b < n; ++b) s -= A[a][b] * x[b];
        x[a] = s / A[a][a];
    }
    double sum = 0;
    for (const auto &r : rows) {
        double e = r[COLUMNS];
        for (int a = 0; a < n; ++a) e -= x[a] * scale[a] * r[columns[a]];
        sum += e * e;
    }
    const double rms = std::sqrt(sum / static_cast<double>(rows.size()));
    if (t) *t = rms > 0 ? std::fabs(x[n - 1]) * std::sqrt(pivot_last) / rms : 0;
    return rms;
}

std::vector<Row> mechanical_rows(const Setup &setup, const std::vector<Truth> &truth, const std::vector<Reading> *readings, double shift) {
    const auto &d = setup.drive;
    const double dt = 1 / setup.sensors.rate_Hz;
    const Window at(dt, 0.016, 0), mean(dt, 0.016, -0.5), input(dt, 0.016, shift);
    const bool angle = setup.sensors.has_q;
    std::vector<Row> rows;
    const auto H = static_cast<std::size_t>(at.half);
    for (std::size_t c = H; c + H < truth.size(); c += H / 2) {
        auto motion = [&](auto q, auto w, double &a, double &v) {
            const double q0 = q(c);
            a = angle ? window_sum(at.k2, at.half, c, [&](std::size_t j) { return q(j) - q0; }) : -window_sum(at.k1, at.half, c, w);
            v = angle ? -window_sum(at.k1, at.half, c, [&](std::size_t j) { return q(j) - q0; }) : window_sum(at.k, at.half, c, w);
        };
        double a, v, a_true, v_true;
        auto q_true = [&](std::size_t j) { return truth[j].q_encoder; };
        auto w_true = [&](std::size_t j) { return truth[j].w; };
        motion(q_true, w_true, a_true, v_true);
        const double torque_true = window_sum(mean.k, at.half, c, [&](std::size_t j) { return truth[j].torque_mean; });
        const double dry = window_sum(mean.k, at.half, c, [&](std::size_t j) { return truth[j].coulomb_mean; });
        const double hidden = torque_true - d.J * a_true - d.B * v_true - d.coulomb * dry;
        a = a_true; v = v_true;
        double torque = torque_true;
        if (readings) {
            motion([&](std::size_t j) { return (*readings)[j].q; }, [&](std::size_t j) { return (*readings)[j].w; }, a, v);
            torque = window_sum(input.k, at.half, c, [&](std::size_t j) { return (*readings)[j].torque; });
        }
        rows.push_back({a, v, d.coulomb > 0 ? dry : 0, 0, hidden, torque});
    }
    return rows;
}

std::vector<Row> electrical_rows(const Setup &setup, const std::vector<Truth> &truth, const std::vector<Reading> *readings, double shift) {
    const auto &d = setup.drive;
    const double dt = 1 / setup.sensors.rate_Hz, L = d.pmsm ? d.L_q : d.L, K = d.pmsm ? d.pole_pairs * d.psi : d.K_e;
    const Window at(dt, 0.016, 0), mean(dt, 0.016, -0.5), input(dt, 0.016, shift);
    std::vector<Row> rows;
    const auto H = static_cast<std::size_t>(at.half);
    for (std::size_t c = H; c + H < truth.size(); c += H / 2) {
        const double v = window_sum(mean.k, at.half, c, [&](std::size_t j) { return truth[j].v_mean; });
        const double i = window_sum(mean.k, at.half, c, [&](std::size_t j) { return truth[j].i_mean; });
        const double i1 = -window_sum(at.k1, at.half, c, [&](std::size_t j) { return truth[j].i; });
        const double w = window_sum(at.k, at.half, c, [&](std::size_t j) { return truth[j].w; });
        const double hidden = v - d.R * i - L * i1 - K * w;
        Row row{i, i1, w, 0, hidden, v};
        if (readings) {
            row[0] = window_sum(input.k, at.half, c, [&](std::size_t j) { return (*readings)[j].i; });
            row[1] = -window_sum(input.k1, at.half, c, [&](std::size_t j) { return (*readings)[j].i; });
            row[COLUMNS] = window_sum(mean.k, at.half, c, [&](std::size_t j) { return (*readings)[j].v; });
            if (!setup.sensors.has_q) row[2] = window_sum(at.k, at.half, c, [&](std::size_t j) { return (*readings)[j].w; });
            else { const double q0 = (*readings)[c].q; row[2] = -window_sum(at.k1, at.half, c, [&](std::size_t j) { return (*readings)[j].q - q0; }); }
        }
        rows.push_back(row);
    }
    return rows;
}

}  // namespace

double Balance::ratio() const { return floor > 0 ? std::sqrt(1 + structural * structural / (floor * floor)) : 1; }

Balance weigh(const Setup &setup, const std::vector<Truth> &truth, const std::vector<Reading> &readings, bool electrical) {
    const auto make = electrical ? electrical_rows : mechanical_rows;
    const std::vector<int> nominal{0, 1, 2}, full{0, 1, 2, 4};
    Balance out;
    auto clean = make(setup, truth, nullptr, 0);
    for (auto &row : clean) row[COLUMNS] = row[4];  // the hidden part itself against the nominal regressors
    out.structural = residual_rms(clean, nominal, nullptr);
    for (double shift : {-0.5, -0.25, 0.0, 0.25, 0.5}) {  // a reading stands for some instant within half a sample of its stamp
        const auto noisy = make(setup, truth, &readings, shift);
        double t = 0;
        const double with = residual_rms(noisy, full, &t), without = residual_rms(noisy, nominal, nullptr);
        if (out.floor == 0 || with < out.floor) { out.floor = with; out.measured = without / with; out.significance = t; }
    }
    return out;
}

Calibration calibrate(Setup &setup, const std::string &effect, double target, double seconds, const Hidden &base) {
    const EffectEntry *entry = find_effect(effect);
    const bool electrical = setup.drive.structure == "dc_circuit" || (entry && entry->electrical);
    auto measure = [&](double size) {
        setup.hidden = base;
        add_effect(effect, size, setup.drive, seconds, setup.seed, setup.hidden);
        std::vector<Reading> readings;
        const auto truth = simulate(setup, 0, seconds, &readings);
        return weigh(setup, truth, readings, electrical);
    };
    Calibration best;
    if (!entry || target <= 1) { best.balance = measure(0); return best; }
    const double wanted = std::sqrt(target * target - 1);  // structural over floor
    // Half a sample of delay is how a reading is taken, not an effect: below two samples the sensors get worse instead.
    const double smallest = effect == "delay" ? 2 / setup.sensors.rate_Hz / 0.006 : 0;
    double size = std::max(std::min(1.0, entry->largest), smallest), lo = 0, hi = 0, best_miss = 1e300;
    for (int n = 0; n < 12; ++n) {
        const Balance b = measure(size);
        const double got = b.floor > 0 ? b.structural / b.floor : 1e9, miss = std::fabs(std::log(got / wanted));
        if (std::isfinite(got) && miss < best_miss) { best_miss = miss; best = {size, b}; }
        if (miss < 0.02) break;
        if (got < wanted) lo = size; else hi = size;
        double next = size * std::clamp(wanted / got, 0.05, 20.0);
        if (lo > 0 && hi > 0 && !(next > lo && next < hi)) next = std::sqrt(lo * hi);
        if (next >= entry->largest && (lo >= entry->largest || got < wanted)) {
            if (size >= 0.999 * entry->largest) {  // as large as such a machine gets: a better sensor instead
                setup.noise *= std::clamp(got / wanted, 0.02, 0.95);
                setup.drive.counts *= std::max(1.0, wanted / got);
                setup.drive.counts = std::floor(setup.drive.counts);
                hi = 0; best_miss = 1e300;
            }
            next = entry->largest;
        }
        if (next < smallest) {
            if (size <= 1.001 * smallest) { setup.noise *= std::clamp(got / wanted, 1.05, 20.0); lo = hi = 0; best_miss = 1e300; }
            next = smallest;
        }
        size = next;
    }
    best.balance = measure(best.size);
    return best;
}

}  // namespace sim
