// SPDX-License-Identifier: Apache-2.0
// Fliess et al. 2006: the model from its physical data, and what section VI says of noise, of least squares, of gamma, alpha and beta. The paper shows figures; its noise is not given.
#include <algorithm>

#include "drive_train.hpp"
#include "page.hpp"

using namespace drive_train_of_fliess;

namespace {

constexpr int runs = 60;
const char *const pole_name[3] = {"real pole", "slow pair", "fast pair"};

double median(std::vector<double> x) {
    std::nth_element(x.begin(), x.begin() + long(x.size() / 2), x.end());
    return x[x.size() / 2];
}

struct Outcome { std::vector<double> error[3]; int within_a_tenth = 0; };

Outcome judged(const driveid_discrete_config &c, double noise) {
    const System g = drive_train();
    Outcome out;
    for (unsigned seed = 1; seed <= runs; seed++) {
        driveid_discrete_f64 e;
        driveid_discrete_estimate found;
        EXPECT_EQ(driveid_discrete_configure_f64(&e, &c, nullptr, 0), DRIVEID_OK);
        const bool answered = identify(e, c, simulated(c.T_s, noise, seed), found) == DRIVEID_OK;
        bool good = answered;
        const auto s = answered ? poles(found, c.domain, c.T_s) : std::vector<C>{};
        for (int k = 0; k < 3; k++) {
            const double error = pole_error(s, g.pole[size_t(k == 0 ? 0 : 2 * k - 1)]);
            out.error[k].push_back(error);
            good &= error < 0.1;
        }
        out.within_a_tenth += good;
    }
    return out;
}

// Coefficients by powers of z of (2/T)^i (z - 1)^i (z + 1)^(n - i), what q^i becomes once the denominator is taken away; of z^i itself in the z domain.
std::vector<double> power_of(driveid_discrete_domain domain, int i, int n, double T) {
    std::vector<double> p{1};
    for (int k = 0; k < n; k++) {
        const bool z = domain == DRIVEID_DISCRETE_Z;
        const double up = z ? k < i : k < i ? 2 / T : 1, down = z ? k >= i : k < i ? -2 / T : 1;   // times (up z + down)
        p.push_back(0);
        for (size_t m = p.size(); m-- > 0;) p[m] = (m ? up * p[m - 1] : 0) + down * p[m];
    }
    return p;
}

// Difference equation by least squares (QR): what sections VI.4 and VI.5 compare with; numerator: its degree.
std::vector<C> least_squares(const Samples &r, double T, driveid_discrete_domain domain = DRIVEID_DISCRETE_Z, int numerator = 4) {
    const int K = int(r.y.size()), n = 5;
    Eigen::MatrixXd P = Eigen::MatrixXd::Zero(K - n, n + 1 + numerator);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(K - n);
    for (int i = 0; i <= n; i++) {
        const auto p = power_of(domain, i, n, T);
        for (int k = 0; k + n < K; k++)
            for (int m = 0; m <= n; m++) {
                if (i < n) P(k, i) += p[size_t(m)] * r.y[size_t(k + m)];
                else right(k) -= p[size_t(m)] * r.y[size_t(k + m)];
                if (i <= numerator) P(k, n + i) += p[size_t(m)] * r.u[size_t(k + m)];
            }
    }
    const Eigen::VectorXd scale = P.colwise().norm();
    const Eigen::VectorXd x = (P * scale.cwiseInverse().asDiagonal()).colPivHouseholderQr().solve(right).cwiseQuotient(scale);
    driveid_discrete_estimate e{};
    for (int i = 0; i < n; i++) e.theta[i] = domain == DRIVEID_DISCRETE_Z ? x(i) : (i + 1 < n ? x(i + 1) : 1) / x(0);   // in q the constant coefficient is one
    return poles(e, domain, T);
}

} // namespace

TEST(Fliess, ModelFromPhysicalData) {
    const double R = 6.38, km = 41e-3, c = 1.72e-3, J[3] = {25.65e-6, 6.44e-6, 5.1e-6}, d[3] = {3.98e-6, .92e-6, 2.4e-6};
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(5, 5); // three speeds, two twists; the armature's inductance is left out
    A(0, 0) = -(d[0] + km * km / R) / J[0], A(0, 3) = -c / J[0];
    A(1, 1) = -d[1] / J[1], A(1, 3) = c / J[1], A(1, 4) = -c / J[1];
    A(2, 2) = -d[2] / J[2], A(2, 4) = c / J[2];
    A(3, 0) = 1, A(3, 1) = -1, A(4, 1) = 1, A(4, 2) = -1;
    Eigen::VectorXd b = Eigen::VectorXd::Zero(5);
    b(0) = km / R / J[0];
    const double V = -A.fullPivLu().solve(b)(2);
    std::vector<double> real, omega, xi;
    const Eigen::VectorXcd poles_of = Eigen::EigenSolver<Eigen::MatrixXd>(A).eigenvalues();
    for (const C s : poles_of) {
        if (std::abs(s.imag()) < 1e-6) real.push_back(-s.real());
        else if (s.imag() > 0) omega.push_back(std::abs(s)), xi.push_back(-s.real() / std::abs(s));
    }
    ASSERT_EQ(real.size(), 1u);
    ASSERT_EQ(omega.size(), 2u);
    const size_t slow = omega[0] < omega[1] ? 0 : 1;
    const page::Table table("Fliess 2006", "G(s) from the physical data", "rounded in print");
    table.near("V", 23.7, V, 23.733, 5e-4);
    table.near("real pole, rad/s", 8.1, real[0], 8.0802, 5e-5);
    table.near("omega_1, rad/s", 12.4, omega[slow], 12.392, 5e-4);
    table.near("xi_1", .1, xi[slow], .1008, 5e-5);
    table.near("omega_2, rad/s", 27.7, omega[1 - slow], 27.682, 5e-4);
    table.near("xi_2", .0083, xi[1 - slow], .00833, 5e-6);
}

TEST(Fliess, LittleNoise) { // NOTES: 3 / .4 / .6 % with all zeros, .3 / .1 / .4 % with none; twice that
    const page::Table table("Fliess 2006", "Poles at 0.1 % coloured noise: median error of 60 runs, %", "the paper shows figures; its noise is about this");
    const double bound[2][3] = {{6, .8, 1.2}, {.6, .2, .8}};
    for (int none = 0; none < 2; none++) {
        const Outcome o = judged(config(DRIVEID_DISCRETE_Q, none ? 0 : 4, .01), .001);
        for (int k = 0; k < 3; k++) table.below(std::string(pole_name[k]) + (none ? ", reduced numerator" : ", full numerator"), page::none, 100 * median(o.error[k]), bound[none][k]);
    }
}

TEST(Fliess, LeastSquaresFails) { // VI.4, VI.5: at .1 % noise 5 to 10 % (slow) and 51 % (fast); at 50 ms better (Remark VI.1)
    const System g = drive_train();
    std::vector<double> slow, fast, slow50, fast50;
    int good = 0;
    for (unsigned seed = 1; seed <= runs; seed++) {
        const auto s = least_squares(simulated(.01, .001, seed), .01), t = least_squares(simulated(.05, .001, seed), .05);
        slow.push_back(pole_error(s, g.pole[1])), fast.push_back(pole_error(s, g.pole[3]));
        slow50.push_back(pole_error(t, g.pole[1])), fast50.push_back(pole_error(t, g.pole[3]));
        good += slow.back() < .01 && fast.back() < .01;
    }
    const page::Table table("Fliess 2006", "Least squares of the difference equation at 0.1 % noise: median error of 60 runs, %", "it fails, as the figures show; a longer sampling time helps (Remark VI.1)");
    table.near("slow pair, 10 ms", page::none, 100 * median(slow), 7.5, 4);
    table.near("fast pair, 10 ms", page::none, 100 * median(fast), 51, 10);
    table.below("runs with both pairs within 1 %", page::none, good, 0);
    table.below("slow pair, 50 ms", page::none, 100 * median(slow50), 2.5);
    table.below("fast pair, 50 ms", page::none, 100 * median(fast50), 1.5);
}

TEST(Fliess, LeastSquaresFailsInEveryForm) { // figure 5 has LS-z and LS-q, VI.5 finds no cure in the reduced numerator: no run has both pairs
    const System g = drive_train();
    const page::Table table("Fliess 2006", "Least squares in z and in q (VI.4, VI.5), 10 ms, 0.1 % noise: runs of 60 with both pairs within 1 %", "the reduced numerator is no cure, as the paper says");
    for (const auto domain : {DRIVEID_DISCRETE_Z, DRIVEID_DISCRETE_Q})
        for (const int numerator : {domain == DRIVEID_DISCRETE_Z ? 4 : 5, 0}) { // a held input gives q's numerator the denominator's degree
            const std::string name = std::string(domain == DRIVEID_DISCRETE_Z ? "LS-z" : "LS-q") + (numerator ? ", full numerator" : ", reduced numerator");
            // without noise the full form finds the poles: it is the noise that it fails by
            if (numerator) {
                const auto s = least_squares(simulated(.01, 0, 1), .01, domain, numerator);
                EXPECT_LT(pole_error(s, g.pole[1]) + pole_error(s, g.pole[3]), 1e-4) << name;
            }
            int good = 0;
            for (unsigned seed = 1; seed <= runs; seed++) {
                const auto s = least_squares(simulated(.01, .001, seed), .01, domain, numerator);
                good += pole_error(s, g.pole[1]) < .01 && pole_error(s, g.pole[3]) < .01;
            }
            table.below(name, page::none, good, 0);
        }
}

TEST(Fliess, GammaAlphaBeta) {
    const auto with = [](double gamma, int alpha, int beta) {
        auto c = config(DRIVEID_DISCRETE_Z, 0, .01);
        c.gamma = gamma, c.skipped = uint8_t(alpha), c.extra = uint8_t(beta);
        return c;
    };
    // 60 runs know a share to 6 points: two of these. NOTES: .39 and .70 at 3 % noise.
    const page::Table gamma("Fliess 2006", "gamma = 1 \"clearly advantageous\": share of 60 runs at 3 % noise with every pole within a tenth", "not so for noise of 20 ms correlation time; the paper's noise is not given");
    const double one = judged(with(1, 7, 10), .03).within_a_tenth / double(runs), less = judged(with(.9, 7, 10), .03).within_a_tenth / double(runs);
    gamma.near("gamma = 1", page::none, one, .39, .13);
    gamma.near("gamma = 0.9", page::none, less, .70, .13);
    EXPECT_GT(less, one + .06);
    const page::Table choice("Fliess 2006", "alpha = 7, beta = 10: share of 60 runs at 1 % noise without every pole within a tenth", "alpha 7 to 10 and beta 0 to 10 are alike; alpha below 5 and beta of 20 are bad");
    struct Row { int alpha, beta; double most; };
    for (const Row r : {Row{7, 10, .1}, {7, 0, .1}, {10, 0, .1}, {10, 10, .15}}) choice.below(page::join("alpha = %g, beta = %g", r.alpha, r.beta), page::none, 1 - judged(with(1, r.alpha, r.beta), .01).within_a_tenth / double(runs), r.most);
    for (const Row r : {Row{3, 10, 0}, {3, 0, 0}}) choice.near(page::join("alpha = %g, beta = %g: bad", r.alpha, r.beta), page::none, 1 - judged(with(1, r.alpha, r.beta), .01).within_a_tenth / double(runs), .95, .05);
    for (const Row r : {Row{7, 20, 0}, {10, 20, 0}}) choice.near(page::join("alpha = %g, beta = %g: worse", r.alpha, r.beta), page::none, 1 - judged(with(1, r.alpha, r.beta), .01).within_a_tenth / double(runs), .5, .25);
}
