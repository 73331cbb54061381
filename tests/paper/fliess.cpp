// SPDX-License-Identifier: Apache-2.0
// Fliess et al. 2006: conditions of the z and q identifiers (tables 10 and 11), poles, behaviour under noise, control application.
// Truth: the drive train's transfer function from its physical data, sampled exactly through residues (exponentials.hpp).
#include <gtest/gtest.h>

#include "drive_train.hpp"
#include "page.hpp"

using namespace drive_train_of_fliess;

namespace {

// Condition of the row-normalised P just before the block ends.
double condition(driveid_discrete_domain domain, int kept, double T) {
    const Samples r = simulated(T);
    const auto c = config(domain, kept, T);
    driveid_discrete_f64 e;
    EXPECT_EQ(driveid_discrete_configure_f64(&e, &c, nullptr, 0), DRIVEID_OK);
    driveid_discrete_f64 before;
    for (size_t k = 0; k < r.y.size(); k++) {
        before = e;
        (void)driveid_discrete_update_f64(&e, r.y[k], r.u[k]);
    }
    const int columns = 5 + kept + 1, rows = columns + 10;
    Eigen::MatrixXd P(rows, columns);
    for (int i = 0; i < rows; i++) {
        for (int j = 0; j < columns; j++) P(i, j) = before.row[i][j];
        P.row(i) /= P.row(i).cwiseAbs().maxCoeff();
    }
    const auto s = Eigen::JacobiSVD<Eigen::MatrixXd>(P).singularValues();
    return s(0) / s(columns - 1);
}

} // namespace

TEST(Fliess, Table10_ConditionAllZeros) {
    // Printed, noise free (columns 4, 5): z 3.0e10 5.2e11 2.9e13 (5.4e14) 8.9e15; q 1.7e10 7.8e9 1.2e10 (1.4e10) 1.5e10.
    // At 0.5 ms z is at one over the machine's precision: its condition is rounding, to 15 %.
    const double T[5] = {.01, .005, .002, .001, .0005};
    const double z[5] = {3.04e10, 5.24e11, 2.94e13, 5.46e14, 9.6e15}, q[5] = {1.70e10, 7.84e9, 1.25e10, 1.43e10, 1.54e10};
    const double printed_z[5] = {3.0e10, 5.2e11, 2.9e13, 5.4e14, 8.9e15}, printed_q[5] = {1.7e10, 7.8e9, 1.2e10, 1.4e10, 1.5e10};
    const page::Table table("Fliess 2006", "Table (10): condition, numerator of full degree", "the input was found by search");
    for (int i = 0; i < 5; i++) {
        table.near(page::join("z, T = %g s", T[i]), printed_z[i], condition(DRIVEID_DISCRETE_Z, 4, T[i]), z[i], (i < 3 ? .01 : i < 4 ? .05 : .15) * z[i]);
        table.near(page::join("q, T = %g s", T[i]), printed_q[i], condition(DRIVEID_DISCRETE_Q, 4, T[i]), q[i], .01 * q[i]);
    }
}

TEST(Fliess, Table11_ConditionReducedNumerator) {
    const double T[5] = {.01, .005, .002, .001, .0005};
    const double z[5] = {1.9e7, 5.8e8, 3.5e10, 6.4e11, 1.1e13}, q[5] = {2.3e7, 2.7e7, 3.0e7, 3.1e7, 3.1e7};  // lost in print; NOTES B4
    const page::Table table("Fliess 2006", "Table (11): condition, reduced numerator", "the table is lost in print");
    for (int i = 0; i < 5; i++) {
        table.near(page::join("z, T = %g s", T[i]), page::none, condition(DRIVEID_DISCRETE_Z, 0, T[i]), z[i], .03 * z[i]);
        table.near(page::join("q, T = %g s", T[i]), page::none, condition(DRIVEID_DISCRETE_Q, 0, T[i]), q[i], .03 * q[i]);
    }
}

TEST(Fliess, NoiseFreePoles) {
    const System g = drive_train();
    for (const auto domain : {DRIVEID_DISCRETE_Z, DRIVEID_DISCRETE_Q}) {
        const auto c = config(domain, 4, .01);
        driveid_discrete_f64 e;
        driveid_discrete_estimate out;
        ASSERT_EQ(driveid_discrete_configure_f64(&e, &c, nullptr, 0), DRIVEID_OK);
        ASSERT_EQ(identify(e, c, simulated(.01), out), DRIVEID_OK);
        const auto found = poles(out, domain, .01);
        // QR: 1e-6 in z, 4e-11 in q (NOTES B3); normal equations would leave an error of order one in z.
        for (const C &p : g.pole) EXPECT_LT(pole_error(found, p), domain == DRIVEID_DISCRETE_Z ? 2e-5 : 1e-8);
    }
    // m~ = 0 carries a structural error of about (omega T)^2: 3e-3 at 10 ms, 3e-5 at 1 ms.
    for (const double T : {.01, .001}) {
        const auto c = config(DRIVEID_DISCRETE_Q, 0, T);
        driveid_discrete_f64 e;
        driveid_discrete_estimate out;
        ASSERT_EQ(driveid_discrete_configure_f64(&e, &c, nullptr, 0), DRIVEID_OK);
        ASSERT_EQ(identify(e, c, simulated(T), out), DRIVEID_OK);
        const auto found = poles(out, DRIVEID_DISCRETE_Q, T);
        for (const C &p : g.pole) EXPECT_LT(pole_error(found, p), T == .01 ? 1e-2 : 1e-4);
    }
}

TEST(Fliess, NoiseReducedNumeratorIsWhatHelps) {
    // 1 % of peak, AR(1) 20 ms: medians 36-47 % / 4 % / 6 % (m~ = 4) against 2 % / .5 % / 3 % (m~ = 0) (NOTES B1). Bounds are twice the median.
    const System g = drive_train();
    std::vector<double> error[2][3];
    for (unsigned seed = 1; seed <= 60; seed++)
        for (int v = 0; v < 2; v++) {
            const auto c = config(DRIVEID_DISCRETE_Q, v ? 4 : 0, .01);
            driveid_discrete_f64 e;
            driveid_discrete_estimate out;
            ASSERT_EQ(driveid_discrete_configure_f64(&e, &c, nullptr, 0), DRIVEID_OK);
            ASSERT_EQ(identify(e, c, simulated(.01, .01, seed), out), DRIVEID_OK);
            const auto found = poles(out, DRIVEID_DISCRETE_Q, .01);
            for (int k = 0; k < 3; k++) error[v][k].push_back(pole_error(found, g.pole[k == 0 ? 0 : 2 * k - 1]));
        }
    double median[2][3];
    for (int v = 0; v < 2; v++)
        for (int k = 0; k < 3; k++) {
            std::nth_element(error[v][k].begin(), error[v][k].begin() + 30, error[v][k].end());
            median[v][k] = error[v][k][30];
        }
    const page::Table table("Fliess 2006", "Poles at 1 % coloured noise: median error of 60 runs, %", "the paper shows figures; its noise is not given");
    const char *pole[3] = {"real pole", "slow pair", "fast pair"};
    const double bound[3] = {6, 1.5, 6};
    for (int k = 0; k < 3; k++) table.below(std::string(pole[k]) + ", reduced numerator", page::none, 100 * median[0][k], bound[k]);
    table.below("real pole: reduced over full numerator", page::none, median[0][0] / median[1][0], .25);
}

TEST(Fliess, FloatInTheQDomain) {
    // Summation by parts: poles within 4e-5 (m~ = 0) in float32 from 1 to 10 ms (NOTES B3); factor 3 for the order of the sums.
    for (const double T : {.01, .005, .002, .001}) {
        const auto c = config(DRIVEID_DISCRETE_Q, 0, T);
        driveid_discrete_f64 d;
        driveid_discrete_f32 f;
        driveid_discrete_estimate reference, out;
        ASSERT_EQ(driveid_discrete_configure_f64(&d, &c, nullptr, 0), DRIVEID_OK);
        ASSERT_EQ(driveid_discrete_configure_f32(&f, &c, nullptr, 0), DRIVEID_OK);
        const Samples r = simulated(T);
        ASSERT_EQ(identify(d, c, r, reference), DRIVEID_OK);
        ASSERT_EQ(identify(f, c, r, out), DRIVEID_OK);
        const auto found = poles(out, DRIVEID_DISCRETE_Q, T);
        for (const C &p : poles(reference, DRIVEID_DISCRETE_Q, T)) EXPECT_LT(pole_error(found, p), 1.2e-4) << T;
    }
}

TEST(Fliess, IntervalFromBlocks) {
    // First-order system, square wave, white noise: the block scatter's interval covers the truth in about 95 % of 300 runs
    // (binomial 99.9 %: 91 to 99 %).
    int inside = 0;
    const double T = .01, a = std::exp(-T / .1);
    for (unsigned seed = 0; seed < 300; seed++) {
        std::mt19937 random(seed + 1);
        std::normal_distribution<double> normal;
        const driveid_discrete_config c{DRIVEID_DISCRETE_Q, 1, 0, 0, 3, 8, 100, T, 1.0};
        driveid_discrete_f64 e;
        ASSERT_EQ(driveid_discrete_configure_f64(&e, &c, nullptr, 0), DRIVEID_OK);
        double x = 0;
        for (int k = 0; k < 2000; k++) {
            const double u = (k / 37) % 2 ? 1 : -1;
            (void)driveid_discrete_update_f64(&e, x + .002 * normal(random), u);
            x = a * x + (1 - a) * u;
        }
        driveid_discrete_estimate out;
        ASSERT_EQ(driveid_discrete_estimate_f64(&e, &out), DRIVEID_OK);
        ASSERT_EQ(out.blocks, 20u);
        const double truth_A1 = 1 / (2 / T * std::tanh(1 / .1 * T / 2));  // pole -W tanh(|s|/W)
        inside += out.lo[0] <= truth_A1 && truth_A1 <= out.hi[0];
    }
    EXPECT_GE(inside, 273);
}

TEST(Fliess, RefusalsAndHostileSamples) {
    char reason[120];
    driveid_discrete_f64 e;
    driveid_discrete_f32 f;
    auto c = config(DRIVEID_DISCRETE_Q, 0, .01);
    c.skipped = 5;
    EXPECT_EQ(driveid_discrete_configure_f64(&e, &c, reason, sizeof reason), DRIVEID_ERR_CONFIG);
    EXPECT_NE(std::string(reason).find("skipped"), std::string::npos);
    c = config(DRIVEID_DISCRETE_Z, 4, .01);
    EXPECT_EQ(driveid_discrete_configure_f32(&f, &c, reason, sizeof reason), DRIVEID_ERR_CONFIG);
    EXPECT_EQ(driveid_discrete_configure_f64(&e, &c, reason, sizeof reason), DRIVEID_OK);
    driveid_discrete_estimate out;
    EXPECT_EQ(driveid_discrete_estimate_f64(&e, &out), DRIVEID_NOT_YET);
    EXPECT_EQ(driveid_discrete_update_f64(&e, std::nan(""), 0), DRIVEID_ERR_VALUE);
    driveid_status status = DRIVEID_OK;
    for (uint32_t k = 0; k < c.block; k++) status = driveid_discrete_update_f64(&e, 1, 1);  // at rest: nothing to learn
    EXPECT_EQ(status, DRIVEID_RANK);
    EXPECT_EQ(driveid_discrete_estimate_f64(&e, &out), DRIVEID_NOT_YET);
}

// A drive at rest, whatever the reading, tells nothing: what is left in the columns is rounding, and no block is an answer.
template <class Estimator, class Configure, class Update>
void at_rest(Configure configure, Update update, bool is_f32) {
    for (const auto domain : {DRIVEID_DISCRETE_Z, DRIVEID_DISCRETE_Q})
        for (uint8_t order = 1; order <= (is_f32 && domain == DRIVEID_DISCRETE_Z ? 2 : 8); order++)
            for (const double y : {0.0, 1.0, 3.7, 1e6}) {
                driveid_discrete_config c{};
                c.domain = domain, c.order = order, c.zeros = c.kept = uint8_t(order / 3), c.skipped = uint8_t(order + 2), c.extra = 6, c.block = 400, c.T_s = .01, c.gamma = 1;
                Estimator e;
                ASSERT_EQ(configure(&e, &c, nullptr, 0), DRIVEID_OK);
                for (uint32_t k = 1; k <= 3 * c.block; k++)
                    EXPECT_EQ(update(&e, y, 1), k % c.block ? DRIVEID_NOT_YET : DRIVEID_RANK) << (domain ? "q" : "z") << " order " << int(order) << " y " << y << (is_f32 ? " f32" : " f64");
            }
}

TEST(Fliess, ConstantRecordHasNoAnswer) {
    at_rest<driveid_discrete_f64>(driveid_discrete_configure_f64, driveid_discrete_update_f64, false);
    at_rest<driveid_discrete_f32>(driveid_discrete_configure_f32, driveid_discrete_update_f32, true);
}

TEST(Fliess, ControlApplication) {
    // Loop shaping on the identified model (V 23.18, real pole 6.89 back-solved in NOTES): Omega_c 1.780, arg L -120.70 degrees, T_s = 10 ms.
    const auto L = [](C q, double V, double p, double w1, double x1, double w2, double x2) {
        const auto pair = [&](double w, double x) { return 1.0 + 2 * x * q / w + q * q / (w * w); };
        const C G = V / ((1.0 + q / p) * pair(w1, x1) * pair(w2, x2));
        return .08 * (1.0 + q / 10.0) / q * pair(12.55, .0923) / pair(12.55, 1) * pair(26.35, 1.5 * .0289) / pair(26.35, 1) * G * std::pow(1.0 - q / 200.0, 5);  // (n - m~)-fold zero at 2/T_s
    };
    double lo = .5, hi = 5;
    for (int i = 0; i < 80; i++) {
        const double w = (lo + hi) / 2;
        (std::abs(L(C(0, w), 23.18, 6.89, 12.55, .0923, 26.35, .0289)) > 1 ? lo : hi) = w;
    }
    const page::Table table("Fliess 2006", "Control application: the loop on the identified model", "V and the real pole of the identified model are not printed and were solved for");
    table.near("Omega_c, rad/s", 1.78, lo, 1.780, 5e-3);
    table.near("arg L, degrees", -120.7, std::arg(L(C(0, lo), 23.18, 6.89, 12.55, .0923, 26.35, .0289)) * 180 / M_PI, -120.70, .05);
}
