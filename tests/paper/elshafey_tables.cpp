// SPDX-License-Identifier: Apache-2.0
// El-Shafey 1987, Tables 3.6 to 3.14 and 4.6: modal parameters of derivatives from averages. The thesis works in single precision with the
// trapezoid; what is asserted is the trapezoid's own error and, with Simpson's rule, the truth.
#include <driveid/modal.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <numbers>

#include "exponentials.hpp"
#include "page.hpp"

using namespace truth;
using std::numbers::pi;

namespace {

using Rows3 = std::array<std::array<double, 3>, 4>;

Signal tone(double omega, C at) { return {{at / 2.0, C(0, omega)}, {std::conj(at) / 2.0, C(0, -omega)}}; }   // re cos - im sin

Signal delayed_sum(const Signal &s, double delay) {   // s(t) + s(t - delay)
    Signal out;
    for (const Term &t : s) out.push_back({t.coefficient * (1.0 + std::exp(-t.exponent * delay)), t.exponent});
    return out;
}

struct Case {
    const char *title;
    driveid_basis basis;
    size_t functions;
    double trapezoid;   // what the trapezoid reaches, of the largest parameter of a derivative
    Rows3 printed;
    std::array<std::array<double, 2>, 4> printed_q;
    double omega;
    C input;               // phasor: u = Re(input e^(j omega t))
    double origin[2];      // the printed q belongs to [sin w(t + s_1 Ts), sin w(t + s_2 Ts)] (NOTES)
};

// q_j of y's tone under the true p_j: D^j y + sum p_ji y(t - T_i), as c_1 sin + c_2 cos.
void true_q(const Case &c, const driveid_modal_task &t, const double *p, int j, double *q) {
    const C s(0, c.omega);
    C gain = std::pow(s, j);
    for (int i = 0; i < 3; i++) gain += p[i] * std::exp(-s * (t.shift[i] * t.T_s));
    gain *= c.input * third_order().response(s);
    q[0] = -gain.imag(), q[1] = gain.real();
}

// The printed q in the basis [sin, cos].
std::array<double, 2> in_our_basis(const Case &c, double T, const std::array<double, 2> &q) {
    const double a = c.omega * c.origin[0] * T, b = c.omega * c.origin[1] * T;
    return {q[0] * std::cos(a) + q[1] * std::cos(b), q[0] * std::sin(a) + q[1] * std::sin(b)};
}

double worst(const double *p, const double *truth_p, size_t n) {
    double error = 0, scale = 0;
    for (size_t i = 0; i < n; i++) error = std::max(error, std::abs(p[i] - truth_p[i])), scale = std::max(scale, std::abs(truth_p[i]));
    return error / scale;
}

void check(const Case &c, driveid_modal_task t, const double *truth_p, const char *why) {
    const page::Table table("El-Shafey 1987", std::string(c.title) + ": worst error of p_j and q_j over their largest element", why);
    for (const auto rule : {DRIVEID_QUADRATURE_TRAPEZOID, DRIVEID_QUADRATURE_SIMPSON}) {
        double p[12], q[8];
        t.basis = c.basis, t.functions = c.functions, t.quadrature = rule;
        ASSERT_EQ(driveid_modal_parameters(&t, 3, p, q), DRIVEID_OK);
        for (size_t j = 0; j < 4; j++)
            table.below((rule == DRIVEID_QUADRATURE_SIMPSON ? "Simpson, p_" : "trapezoid, p_") + std::to_string(j), worst(c.printed[j].data(), truth_p + 3 * j, 3),
                        worst(p + 3 * j, truth_p + 3 * j, 3), rule == DRIVEID_QUADRATURE_SIMPSON ? 1e-5 : c.trapezoid);
        for (int j = 0; j < 4; j++) {
            double truth_q[2];
            true_q(c, t, truth_p + 3 * j, j, truth_q);
            table.below((rule == DRIVEID_QUADRATURE_SIMPSON ? "Simpson, q_" : "trapezoid, q_") + std::to_string(j), worst(in_our_basis(c, t.T_s, c.printed_q[size_t(j)]).data(), truth_q, 2),
                        worst(q + 2 * j, truth_q, 2), rule == DRIVEID_QUADRATURE_SIMPSON ? 1e-5 : c.trapezoid);
        }
    }
}

std::vector<double> sampled(const Signal &s, double T, size_t count) {
    std::vector<double> y;
    for (size_t k = 0; k < count; k++) y.push_back(value(s, double(k) * T));
    return y;
}

std::vector<double> modes(double omega, double T, size_t count) {
    std::vector<double> x;
    for (size_t k = 0; k < count; k++) x.push_back(std::sin(omega * double(k) * T)), x.push_back(std::cos(omega * double(k) * T));
    return x;
}

} // namespace

TEST(ElShafey, Tables3_6_And_3_7_AgainstPrint) {
    const double T = pi / 420;
    const auto y = sampled(third_order().forced(tone(4, C(0, -1))), T, 601), x = modes(4, T, 601);
    const int32_t shift[3] = {40, 80, 120};
    const double a[3] = {52, 30, 4};
    const size_t first = 120, last = 504;
    double truth_p[12];
    ASSERT_EQ(driveid_modal_parameters_from_a(3, a, T, shift, 3, truth_p), DRIVEID_OK);
    driveid_modal_task t{};
    t.order = 3, t.T_s = T, t.rows = y.size(), t.y = y.data(), t.modes = 2, t.mode = x.data(), t.shift = shift, t.windows = 1, t.first = &first, t.last = &last;
    check({"Table 3.6 (Fourier)", DRIVEID_BASIS_FOURIER, 6, 2e-3, {{{-.6617, .6111, -.3029}, {2.974, -.2529, -.4526}, {5.757, -14.81, 5.737}, {-78.15, 34.91, 6.237}}}, {{{.9608, 1.448}, {5.126, 5.592}, {5.580, -8.856}, {-110.7, -155.7}}}, 4, C(0, -1), {37.5, -51}}, t, truth_p, "single precision in the thesis");
    check({"Table 3.7 (Walsh)", DRIVEID_BASIS_WALSH, 8, 1e-3, {{{-.6605, .6113, -.3022}, {3.002, -.2543, -.4325}, {5.715, -14.77, 5.718}, {-78.50, 34.90, 5.870}}}, {{{.8717, 1.370}, {4.750, 5.265}, {6.102, -8.434}, {-100.9, -147.0}}}, 4, C(0, -1), {37.5, -50}}, t, truth_p, "single precision in the thesis");
}

TEST(ElShafey, Tables3_8_to_3_12_FilteredPairs) {
    const double period = 2 * pi / 3, T = period / 384;
    const Signal u_response = third_order().forced([] { Signal u = tone(6, 1); const Signal v = tone(3, C(0, 1)); u.insert(u.end(), v.begin(), v.end()); return u; }());
    const int32_t shift[3] = {40, 80, 120};
    const double a[3] = {52, 30, 4};
    const size_t first = 120, last = 504;
    double truth_p[12];
    ASSERT_EQ(driveid_modal_parameters_from_a(3, a, T, shift, 3, truth_p), DRIVEID_OK);
    const Case cases[4] = {
        {"Table 3.8 (Fourier, tone 3)", DRIVEID_BASIS_FOURIER, 6, 2e-3, {{{-1.390, 1.128, -.4190}, {.7137, 2.994, -1.701}, {22.71, -26.40, 6.527}, {-39.97, -42.91, 46.71}}}, {{{-.3362, .4154}, {-1.629, 2.898}, {4.215, 6.785}, {72.36, -46.58}}}, 3, C(1, 1), {-120, 168}},
        {"Table 3.9 (Fourier, tone 6)", DRIVEID_BASIS_FOURIER, 6, 2e-3, {{{-1.387, 1.124, -.4168}, {.7382, 2.968, -1.684}, {22.52, -26.22, 6.424}, {-40.38, -42.24, 46.34}}}, {{{-.9154, -.08869}, {-5.276, 1.354}, {3.682, 23.80}, {227.9, 53.18}}}, 6, C(2, 0), {-72, 72}},
        {"Table 3.11 (Walsh, tone 3)", DRIVEID_BASIS_WALSH, 8, 1e-3, {{{-1.388, 1.126, -.4179}, {.7306, 2.975, -1.688}, {22.63, -26.32, 6.474}, {-40.24, -42.56, 46.49}}}, {{{-.3434, .4151}, {-1.683, 2.893}, {4.137, 6.802}, {73.20, -46.54}}}, 3, C(1, 1), {-120, 169}},
        {"Table 3.12 (Walsh, tone 6)", DRIVEID_BASIS_WALSH, 8, 1e-3, {{{-1.388, 1.126, -.4179}, {.7314, 2.973, -1.687}, {22.62, -26.30, 6.467}, {-40.23, -42.54, 46.47}}}, {{{-.9128, -.08730}, {-5.325, 1.364}, {2.981, 23.71}, {226.1, 52.83}}}, 6, C(2, 0), {-72, 73}},
    };
    for (int k = 0; k < 4; k++) {
        const bool three = k % 2 == 0;
        const auto y = sampled(delayed_sum(u_response, three ? period / 4 : period / 2), T, 520), x = modes(three ? 3 : 6, T, 520);
        driveid_modal_task t{};
        t.order = 3, t.T_s = T, t.rows = y.size(), t.y = y.data(), t.modes = 2, t.mode = x.data(), t.shift = shift, t.windows = 1, t.first = &first, t.last = &last;
        check(cases[k], t, truth_p, "single precision in the thesis; misprints of 3.8 and 3.12 mended");
    }
}

// Example 3.10: the fourth-order system under a square wave of period pi from y(0) = 0.2; y(t) + y(t - T_o/2) is a free response.
TEST(ElShafey, Tables3_13_3_14_And_4_6_SquareWave) {
    const double T = pi / 420;
    const System system = fourth_order();
    const Signal start = system.free({.2, 0, 0, 0});
    std::vector<std::pair<double, double>> edge{{0, 1}};
    for (int k = 1; k < 8; k++) edge.push_back({k * pi / 2, k % 2 ? -2 : 2});
    std::vector<double> y;
    for (int k = 0; k < 1000; k++) {
        const double t = k * T + 1e-12;
        y.push_back(value(start, t) + system.steps(edge, t));
    }
    std::vector<double> filtered(y.size(), 0);
    for (size_t k = 210; k < y.size(); k++) filtered[k] = y[k] + y[k - 210];
    const int32_t shift[4] = {20, 40, 110, 160};
    const double a_true[4] = {338, 221, 115.25, 6};
    const size_t first = 210 + 160, last = first + 420;
    driveid_modal_task t{};
    t.order = 4, t.T_s = T, t.rows = filtered.size(), t.y = filtered.data(), t.shift = shift, t.windows = 1, t.first = &first, t.last = &last;
    double truth_p[20];
    ASSERT_EQ(driveid_modal_parameters_from_a(4, a_true, T, shift, 4, truth_p), DRIVEID_OK);
    const double printed_p[2][20] = {{-1.042, -.0222, .2179, -.0577, 2.992, -2.784, 1.236, -.09301, 26.58, -15.45, -8.259, 5.245, -406.3, 426.8, -78.17, 7.556, -938.4, -153.7, 1074, -610.0},
                                     {-1.042, -.0220, .2179, -.05769, 2.990, -2.808, 1.262, -.1059, 27.60, -16.35, -8.266, 5.330, -412.6, 435.0, -81.11, 8.519, -1016, -98.21, 1088, -623.1}};
    const double printed_a[2][4] = {{337.9, 221.1, 115.3, 5.995}, {338.3, 221.2, 115.4, 6.006}};
    for (const auto basis : {DRIVEID_BASIS_FOURIER, DRIVEID_BASIS_WALSH}) {
        const bool walsh = basis == DRIVEID_BASIS_WALSH;
        // 420 intervals in eight blocks are 52.5: Walsh functions need whole blocks, so they take 416 of them
        const size_t end = walsh ? first + 416 : last;
        t.basis = basis, t.functions = 8, t.last = &end;
        const page::Table modal("El-Shafey 1987", walsh ? "Table 3.14 (Walsh): worst error of p_j over its largest element" : "Table 3.13 (Fourier): worst error of p_j over its largest element",
                                walsh ? "416 of the 420 intervals: eight blocks of 52.5 samples are none" : "the thesis takes every second sample");
        const page::Table model("El-Shafey 1987", walsh ? "Table 4.6 (Walsh): a" : "Table 4.6 (Fourier): a", "the printed second pole of the Walsh column has a wrong sign");
        for (const auto rule : {DRIVEID_QUADRATURE_TRAPEZOID, DRIVEID_QUADRATURE_SIMPSON}) {
            const bool simpson = rule == DRIVEID_QUADRATURE_SIMPSON;
            double p[20], a[4];
            t.quadrature = rule;
            ASSERT_EQ(driveid_modal_parameters(&t, 4, p, nullptr), DRIVEID_OK);
            for (size_t j = 0; j < 5; j++)
                modal.below((simpson ? "Simpson, p_" : "trapezoid, p_") + std::to_string(j), worst(printed_p[walsh] + 4 * j, truth_p + 4 * j, 4), worst(p + 4 * j, truth_p + 4 * j, 4), simpson ? 2e-4 : 2e-2);
            ASSERT_EQ(driveid_modal_a(4, p, a), DRIVEID_OK);
            for (int i = 0; i < 4; i++) model.near((simpson ? "Simpson, a_" : "trapezoid, a_") + std::to_string(i), printed_a[walsh][i], a[i], a_true[i], (simpson ? 1e-4 : 2e-3) * a_true[i]);
        }
    }
}
