// SPDX-License-Identifier: Apache-2.0
// Loop shaping on an identified model: Fliess et al. 2006, section VI.B, with the choice of gain and zero made by the wish for a phase margin.
#include "batch/lti_filter.hpp"

#include <driveid/control.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>

using driveid::modal::MatrixXd;
using driveid::modal::VectorXd;
using Complex = std::complex<double>;

namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// Zero-order-hold equivalent of the model: x+ = A x + B u(k - delay), y = c x.
struct Plant {
    MatrixXd A;
    VectorXd B, c;
    std::size_t delay = 0; // samples of T_s, rounded up
    double T_s = 0;
};

bool valid(const driveid_lti_model *m) {
    return m && m->order >= 1 && m->order <= DRIVEID_LTI_ORDER_MAX && m->zeros < m->order;
}

bool valid(const driveid_controller *r) {
    if (!r || !(r->T_s > 0) || !std::isfinite(r->gain) || !(r->zero_rad_s >= 0) || r->notches > DRIVEID_NOTCH_MAX) return false;
    return std::all_of(r->notch, r->notch + r->notches, [](const driveid_notch &n) { return n.omega_rad_s > 0 && n.zeta_from >= 0 && n.zeta_to > 0; });
}

Plant sampled(const driveid_lti_model &m, double T_s) {
    const auto n = static_cast<Eigen::Index>(m.order);
    Plant p;
    p.T_s = T_s;
    // Time in units of the fastest mode, so that the states are of one size.
    double w = 0;
    for (Eigen::Index i = 0; i < n; i++) w = std::max(w, std::pow(std::abs(m.a[i]), 1.0 / static_cast<double>(n - i)));
    if (!(w > 0)) w = 1;
    VectorXd a(n);
    p.c = VectorXd::Zero(n);
    for (Eigen::Index i = 0; i < n; i++) {
        const double scale = std::pow(w, static_cast<double>(i - n));
        a(i) = m.a[i] * scale;
        if (i <= static_cast<Eigen::Index>(m.zeros)) p.c(i) = m.b[i] * scale;
    }
    MatrixXd block = MatrixXd::Zero(n + 1, n + 1);
    block.topLeftCorner(n, n) = driveid::modal::companion(m.order, a.data()) * (T_s * w);
    block(n - 1, n) = T_s * w;
    const MatrixXd e = driveid::modal::exponential(block, 1);
    p.A = e.topLeftCorner(n, n);
    p.B = e.topRightCorner(n, 1);
    p.delay = static_cast<std::size_t>(std::ceil(static_cast<double>(m.delay) * m.T_s / T_s - 1e-9));
    return p;
}

// (z I - A)^-1 B by elimination with pivoting, then c'.
Complex response(const Plant &p, Complex z) {
    const Eigen::Index n = p.A.rows();
    Eigen::MatrixXcd M(n, n + 1);
    M.leftCols(n) = -p.A.cast<Complex>();
    M.diagonal().array() += z;
    M.col(n) = p.B.cast<Complex>();
    for (Eigen::Index k = 0; k < n; k++) {
        Eigen::Index best = k;
        for (Eigen::Index i = k + 1; i < n; i++)
            if (std::abs(M(i, k)) > std::abs(M(best, k))) best = i;
        M.row(k).swap(M.row(best));
        for (Eigen::Index i = k + 1; i < n; i++) M.row(i) -= (M(i, k) / M(k, k) * M.row(k)).eval();
    }
    Complex y = 0;
    for (Eigen::Index k = n; k-- > 0;) {
        for (Eigen::Index j = k + 1; j < n; j++) M(k, n) -= M(k, j) * M(j, n);
        M(k, n) /= M(k, k);
        y += p.c(k) * M(k, n);
    }
    return y * std::pow(z, -static_cast<double>(p.delay));
}

Complex plant_at(const Plant &p, double Omega) {
    const Complex h(0, Omega * p.T_s / 2);
    return response(p, (1. + h) / (1. - h));
}

Complex notches_at(const driveid_controller &r, double Omega) {
    Complex product = 1;
    for (std::size_t k = 0; k < r.notches; k++) {
        const double x = Omega / r.notch[k].omega_rad_s;
        product *= Complex(1 - x * x, 2 * r.notch[k].zeta_from * x) / Complex(1 - x * x, 2 * r.notch[k].zeta_to * x);
    }
    return product;
}

Complex pi_at(const driveid_controller &r, double Omega) {
    const Complex q(0, Omega);
    return r.gain * (r.zero_rad_s > 0 ? 1. + q / r.zero_rad_s : Complex(1)) / q;
}

struct Point {
    double Omega;
    Complex L;
    double phase; // rad, unwrapped from the lowest frequency
};

// Frequencies dense enough to see each notch and pole pair; from well below the slowest to well above what the sampling shows.
template <class F>
std::vector<Point> curve(const driveid_lti_model &m, double T_s, F loop) {
    driveid_lti_modes modes{};
    double low = 1e-3 / T_s, high = 200 / T_s;
    std::vector<double> at;
    if (driveid_lti_modes_of(&m, &modes) == DRIVEID_OK)
        for (std::size_t k = 0; k < modes.poles; k++) {
            if (modes.omega_rad_s[k] > 0) low = std::min(low, 1e-3 * modes.omega_rad_s[k]);
            for (int j = -40; j <= 40; j++) // within some widths of each resonance
                at.push_back(modes.omega_rad_s[k] * std::exp(0.1 * j * std::max(std::abs(modes.zeta[k]), 1e-3)));
        }
    for (double w = low; w < high; w *= 1.01) at.push_back(w);
    std::sort(at.begin(), at.end());
    std::vector<Point> points;
    for (const double w : at) {
        if (!(w > 0) || !std::isfinite(w)) continue;
        const Complex L = loop(w);
        double phase = std::arg(L);
        if (!points.empty()) phase += 2 * std::numbers::pi * std::round((points.back().phase - phase) / (2 * std::numbers::pi));
        points.push_back({w, L, phase});
    }
    return points;
}

// Root of a sign change between two frequencies, on a logarithmic scale.
template <class F>
double crossing(double lo, double hi, F value) {
    const bool rising = value(hi) > 0;
    for (int k = 0; k < 60; k++) {
        const double mid = std::sqrt(lo * hi);
        ((value(mid) > 0) == rising ? hi : lo) = mid;
    }
    return std::sqrt(lo * hi);
}

// Runs the loop with unit reference; state is kept in sections, so that fast sampling costs no digits.
class Loop {
public:
    Loop(const Plant &plant, const driveid_controller &r) : plant_(plant), x_(VectorXd::Zero(plant.A.rows())), waiting_(plant.delay, 0.0), sections_(1 + r.notches) {
        double table[1 + DRIVEID_NOTCH_MAX][5];
        (void)driveid_controller_sections(&r, table);
        for (std::size_t k = 0; k < sections_.size(); k++) std::copy(table[k], table[k] + 5, sections_[k].c);
    }
    double step(double reference) {
        const double y = plant_.c.dot(x_);
        double v = reference - y;
        for (Section &s : sections_) {
            const double out = s.c[0] * v + s.s1;
            s.s1 = s.c[1] * v - s.c[3] * out + s.s2;
            s.s2 = s.c[2] * v - s.c[4] * out;
            v = out;
        }
        if (!waiting_.empty()) {
            std::swap(v, waiting_[at_]);
            at_ = (at_ + 1) % waiting_.size();
        }
        x_ = (plant_.A * x_ + plant_.B * v).eval();
        return y;
    }
    // One step without reference as a linear map: column of the state matrix for each unit state.
    std::size_t states() const { return static_cast<std::size_t>(x_.size()) + waiting_.size() + 2 * sections_.size(); }
    double &state(std::size_t k) {
        if (k < static_cast<std::size_t>(x_.size())) return x_(static_cast<Eigen::Index>(k));
        k -= static_cast<std::size_t>(x_.size());
        if (k < waiting_.size()) return waiting_[(at_ + k) % waiting_.size()];
        k -= waiting_.size();
        return k % 2 ? sections_[k / 2].s2 : sections_[k / 2].s1;
    }

private:
    struct Section {
        double c[5] = {}, s1 = 0, s2 = 0;
    };
    const Plant &plant_;
    VectorXd x_;
    std::vector<double> waiting_;
    std::size_t at_ = 0;
    std::vector<Section> sections_;
};

bool stable(const Plant &plant, const driveid_controller &r) {
    const std::size_t n = Loop(plant, r).states();
    MatrixXd M(n, n);
    for (std::size_t j = 0; j < n; j++) {
        Loop loop(plant, r);
        loop.state(j) = 1;
        (void)loop.step(0);
        for (std::size_t i = 0; i < n; i++) M(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = loop.state(i);
    }
    return driveid::modal::eigenvalues(M).cwiseAbs().maxCoeff() < 1 - 1e-9;
}

driveid_loop_margins margins_of(const driveid_lti_model &m, const Plant &plant, const driveid_controller &r) {
    const auto loop = [&](double w) { return pi_at(r, w) * notches_at(r, w) * plant_at(plant, w); };
    const auto points = curve(m, r.T_s, loop);
    driveid_loop_margins out{kNan, kNan, kNan, std::numeric_limits<double>::infinity(), 0};
    for (std::size_t k = 1; k < points.size(); k++) {
        const Point &a = points[k - 1], &b = points[k];
        if ((std::abs(a.L) > 1) != (std::abs(b.L) > 1)) {
            out.crossover_rad_s = crossing(a.Omega, b.Omega, [&](double w) { return std::abs(loop(w)) - 1; });
            out.phase_margin_deg = std::remainder(180 + std::arg(loop(out.crossover_rad_s)) / kDegree, 360);
        }
        if ((a.L.imag() > 0) != (b.L.imag() > 0) && a.L.real() < 0 && b.L.real() < 0) {
            const double w = crossing(a.Omega, b.Omega, [&](double x) { return loop(x).imag(); });
            const double db = -20 * std::log10(std::abs(loop(w)));
            if (db > 0 && db < out.gain_margin_db) out.gain_margin_db = db, out.phase_crossover_rad_s = w;
        }
    }
    out.stable = stable(plant, r);
    return out;
}

// Notches for the pole pairs that ring.
void add_notches(const driveid_lti_model &m, const driveid_loop_wish &wish, driveid_controller &r) {
    const double below = wish.notch_below_zeta > 0 ? wish.notch_below_zeta : 0.3, widen = wish.notch_widen > 0 ? wish.notch_widen : 1.5;
    driveid_lti_modes modes{};
    if (driveid_lti_modes_of(&m, &modes) != DRIVEID_OK) return;
    for (std::size_t k = 0; k < modes.poles && r.notches < DRIVEID_NOTCH_MAX; k++) {
        if (modes.pole_im[k] <= 0 || modes.zeta[k] >= below || modes.zeta[k] < 0) continue;
        // The pole pair's place in the q plane: Omega_0 tanh(s / Omega_0), Omega_0 = 2/T.
        const Complex q = 2 / wish.T_s * std::tanh(Complex(modes.pole_re[k], modes.pole_im[k]) * wish.T_s / 2.);
        r.notch[r.notches++] = {std::abs(q), -widen * q.real() / std::abs(q), 1};
    }
}

// PI term for a crossover; false where its phase cannot give the margin there.
bool shape(double margin_rad, const Point &at, driveid_controller &r, double sign, double *best_deg) {
    // The PI term turns by -90 degrees (integral alone) up to nearly 0 (zero far below the crossover; a fiftieth is the limit).
    const double needed = margin_rad - std::numbers::pi - at.phase, most = -std::atan(0.02);
    if (best_deg) *best_deg = (std::numbers::pi + at.phase + most) / kDegree;
    if (needed > most) return false;
    const double lead = needed + std::numbers::pi / 2; // above the integral's
    r.zero_rad_s = lead > 1e-6 ? at.Omega / std::tan(lead) : 0;
    r.gain = 1;
    r.gain = sign / std::abs(pi_at(r, at.Omega) * at.L);
    return true;
}

} // namespace

driveid_status driveid_loop_design(const driveid_lti_model *plant, const driveid_loop_wish *wish, driveid_controller *controller, double *reachable_deg) {
    if (reachable_deg) *reachable_deg = kNan;
    if (!valid(plant) || !wish || !controller || !(wish->T_s > 0) || !(wish->phase_margin_deg >= 20 && wish->phase_margin_deg <= 85) || !(wish->crossover_rad_s >= 0))
        return DRIVEID_ERR_ARGUMENT;
    const Plant p = sampled(*plant, wish->T_s);
    driveid_controller r{};
    r.T_s = wish->T_s;
    add_notches(*plant, *wish, r);
    const auto open = [&](double w) { return notches_at(r, w) * plant_at(p, w); };
    auto points = curve(*plant, wish->T_s, open);
    if (points.empty() || !(std::abs(points.front().L) > 0)) return DRIVEID_ERR_DATA;
    // A plant that turns the other way is controlled with a negative gain.
    const double sign = points.front().L.real() < 0 && std::abs(points.front().phase) > 0.75 * std::numbers::pi ? -1 : 1;
    if (sign < 0)
        for (Point &x : points) x.phase -= std::copysign(std::numbers::pi, points.front().phase);
    const double margin = wish->phase_margin_deg * kDegree;
    if (wish->crossover_rad_s > 0) {
        const auto above = std::lower_bound(points.begin(), points.end(), wish->crossover_rad_s, [](const Point &x, double w) { return x.Omega < w; });
        if (above == points.end()) return DRIVEID_ERR_DATA;
        const Complex L = open(wish->crossover_rad_s);
        const double phase = std::arg(sign * L);
        const Point at{wish->crossover_rad_s, L, phase + 2 * std::numbers::pi * std::round((above->phase - phase) / (2 * std::numbers::pi))};
        if (!shape(margin, at, r, sign, reachable_deg)) return DRIVEID_ERR_DATA;
        *controller = r;
        return margins_of(*plant, p, r).stable ? DRIVEID_OK : DRIVEID_ERR_DATA;
    }
    // Down from the fastest crossover at which a PI zero at a third of it leaves the phase margin, until the gain margin holds too.
    const double lag = std::atan(1. / 3);
    for (std::size_t k = points.size(); k-- > 0;) {
        if (points[k].phase - lag + std::numbers::pi < margin || points[k].Omega > 1 / wish->T_s) continue;
        driveid_controller candidate = r;
        candidate.zero_rad_s = points[k].Omega / 3;
        candidate.gain = 1;
        candidate.gain = sign / std::abs(pi_at(candidate, points[k].Omega) * points[k].L);
        const auto m = margins_of(*plant, p, candidate);
        if (m.stable && m.gain_margin_db >= 6 && m.phase_margin_deg >= wish->phase_margin_deg - 0.5) {
            *controller = candidate;
            return DRIVEID_OK;
        }
        const double next = points[k].Omega * 0.93;
        while (k > 0 && points[k].Omega > next) k--;
    }
    return DRIVEID_ERR_DATA;
}

driveid_status driveid_loop_frequency(const driveid_lti_model *plant, const driveid_controller *controller, size_t count, const double *Omega, double *re, double *im) {
    if (!valid(plant) || !valid(controller) || !Omega || !re || !im) return DRIVEID_ERR_ARGUMENT;
    const Plant p = sampled(*plant, controller->T_s);
    for (size_t k = 0; k < count; k++) {
        const Complex L = pi_at(*controller, Omega[k]) * notches_at(*controller, Omega[k]) * plant_at(p, Omega[k]);
        re[k] = L.real();
        im[k] = L.imag();
    }
    return DRIVEID_OK;
}

driveid_status driveid_loop_margins_of(const driveid_lti_model *plant, const driveid_controller *controller, driveid_loop_margins *margins) {
    if (!valid(plant) || !valid(controller) || !margins) return DRIVEID_ERR_ARGUMENT;
    *margins = margins_of(*plant, sampled(*plant, controller->T_s), *controller);
    return DRIVEID_OK;
}

driveid_status driveid_loop_step(const driveid_lti_model *plant, const driveid_controller *controller, size_t count, double *y, driveid_step_figures *figures) {
    if (!valid(plant) || !valid(controller) || !y || count == 0) return DRIVEID_ERR_ARGUMENT;
    const Plant p = sampled(*plant, controller->T_s);
    Loop loop(p, *controller);
    for (size_t k = 0; k < count; k++) y[k] = loop.step(1);
    if (!figures) return DRIVEID_OK;
    const double peak = *std::max_element(y, y + count);
    const auto risen = std::find_if(y, y + count, [](double v) { return v >= 0.9; });
    size_t outside = count;
    while (outside > 0 && std::abs(y[outside - 1] - 1) <= 0.02) outside--;
    figures->t90_s = risen == y + count ? kNan : static_cast<double>(risen - y) * p.T_s;
    figures->overshoot_percent = 100 * std::max(0.0, peak - 1);
    figures->settling_s = outside == count ? kNan : static_cast<double>(outside) * p.T_s;
    return DRIVEID_OK;
}

driveid_status driveid_controller_sections(const driveid_controller *controller, double (*section)[5]) {
    if (!valid(controller) || !section) return DRIVEID_ERR_ARGUMENT;
    const double W = 2 / controller->T_s, lead = controller->zero_rad_s > 0 ? W / controller->zero_rad_s : 0;
    // gain (1 + q/zero)/q at q = W (z-1)/(z+1)
    const double pi[5] = {controller->gain / W * (1 + lead), controller->gain / W * (1 - lead), 0, -1, 0};
    std::copy(pi, pi + 5, section[0]);
    for (size_t k = 0; k < controller->notches; k++) {
        const driveid_notch &n = controller->notch[k];
        const double x = W / n.omega_rad_s, below = 1 + 2 * n.zeta_to * x + x * x;
        const double s[5] = {(1 + 2 * n.zeta_from * x + x * x) / below, 2 * (1 - x * x) / below, (1 - 2 * n.zeta_from * x + x * x) / below,
                             2 * (1 - x * x) / below, (1 - 2 * n.zeta_to * x + x * x) / below};
        std::copy(s, s + 5, section[k + 1]);
    }
    return DRIVEID_OK;
}
