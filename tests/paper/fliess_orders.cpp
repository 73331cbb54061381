// SPDX-License-Identifier: Apache-2.0
// discrete.h at orders 6 to 8, noise-free, one block: the poles, or DRIVEID_RANK where rounding would reach them; and a block begun anew.
#include "drive_train.hpp"

using namespace drive_train_of_fliess;

namespace {

constexpr double T = .01;

// Damped pairs from 8 rad/s on, and a real pole where the order is odd.
System plant(int order, double damping, double spread) {
    System g{{1}, {}};
    for (int i = 0; i + 1 < order; i += 2) {
        const C pole = 8 * (1 + spread * i / 2) * C(-damping, std::sqrt(1 - damping * damping));
        g.pole.push_back(pole), g.pole.push_back(std::conj(pole));
    }
    if (order % 2) g.pole.push_back(C(-5, 0));
    g.b[0] = g.denominator(0).real();
    return g;
}

// Four steps of alternating sign, scaled into the record.
Samples stepped(const System &g, int K) {
    Samples r;
    const Signal unit = g.forced({{1, 0}});
    for (int k = 0; k < K; k++) {
        double y = 0, u = 0;
        for (int i = 0; i < 4; i++) {
            const int at = static_cast<int>((.04 + .23 * i) * K);
            const double size = (i % 2 ? -1 : 1) * (i ? 1.9 : 1);
            if (k >= at) u += size, y += size * value(unit, (k - at) * T);
        }
        r.u.push_back(u), r.y.push_back(y);
    }
    return r;
}

driveid_discrete_config full(driveid_discrete_domain domain, int n, int K) {
    return {domain, uint8_t(n), uint8_t(n - 1), uint8_t(n - 1), uint8_t(n + 2), 10, uint32_t(K), T, 1};
}

// The companion matrix in p / 15 rad/s: unscaled its eigenvalues would lose what is tested.
double worst_pole(const driveid_discrete_estimate &e, driveid_discrete_domain domain, const System &g) {
    const int n = static_cast<int>(g.pole.size());
    const bool q = domain == DRIVEID_DISCRETE_Q;
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n, n);
    A.topRightCorner(n - 1, n - 1).setIdentity();
    for (int i = 0; i < n; i++) A(n - 1, i) = q ? -(i == 0 ? 1 : e.theta[i - 1]) / e.theta[n - 1] * std::pow(15., i - n) : -e.theta[i];
    std::vector<C> found;
    const Eigen::VectorXcd roots = Eigen::EigenSolver<Eigen::MatrixXd>(A).eigenvalues();
    for (const C root : roots) found.push_back(q ? 2 / T * std::atanh(15. * root * T / 2.) : std::log(root) / T);
    double worst = 0;
    for (const C &pole : g.pole) worst = std::max(worst, pole_error(found, pole));
    return worst;
}

} // namespace

TEST(FliessOrders, SixToEightAreRightOrRefused) {
    for (const auto domain : {DRIVEID_DISCRETE_Z, DRIVEID_DISCRETE_Q})
        for (int n = 6; n <= 8; n++) {
            int answers = 0, refusals = 0;
            for (const auto &[damping, spread] : {std::pair{.15, .8}, {.3, 1.3}, {.08, .8}})
                for (const int K : {200, 400, 1200}) {
                    const System g = plant(n, damping, spread);
                    const auto c = full(domain, n, K);
                    driveid_discrete_f64 e;
                    driveid_discrete_estimate out;
                    ASSERT_EQ(driveid_discrete_configure_f64(&e, &c, nullptr, 0), DRIVEID_OK);
                    const driveid_status status = identify(e, c, stepped(g, K), out);
                    if (status == DRIVEID_RANK) {
                        refusals++;
                        continue;
                    }
                    ASSERT_EQ(status, DRIVEID_OK);
                    answers++;
                    // A coefficient may move by 1e-3, a pole by ten times that. q over a block of two slow periods: 2e-6 and better.
                    EXPECT_LT(worst_pole(out, domain, g), domain == DRIVEID_DISCRETE_Q && K == 200 ? 2e-5 : 1e-2) << (domain ? "q" : "z") << " order " << n << " K " << K << " damping " << damping;
                }
            std::printf("%s order %d: %d answers, %d refused\n", domain ? "q" : "z", n, answers, refusals);
            EXPECT_GE(answers, domain == DRIVEID_DISCRETE_Q ? 3 : 0) << n;
            EXPECT_GE(refusals, 1) << n;
        }
}

TEST(FliessOrders, UndampedPairHasItsZeroCoefficient) {
    const System g{{64}, {C(0, 8), C(0, -8)}};
    const auto c = full(DRIVEID_DISCRETE_Q, 2, 400);
    driveid_discrete_f64 e;
    driveid_discrete_estimate out;
    ASSERT_EQ(driveid_discrete_configure_f64(&e, &c, nullptr, 0), DRIVEID_OK);
    ASSERT_EQ(identify(e, c, stepped(g, 400), out), DRIVEID_OK);
    EXPECT_LT(worst_pole(out, DRIVEID_DISCRETE_Q, g), 1e-8);
}

template <class Estimator, class Configure, class Update, class Ask, class Restart>
void begun_anew(Configure configure, Update update, Ask ask, Restart restart) {
    const int K = 200;
    const Samples r = stepped(plant(2, .15, .8), K);
    const auto c = full(DRIVEID_DISCRETE_Q, 2, K);
    Estimator e;
    driveid_discrete_estimate first, second;
    ASSERT_EQ(configure(&e, &c, nullptr, 0), DRIVEID_OK);
    for (int k = 0; k < K; k++) (void)update(&e, r.y[k], r.u[k]);
    ASSERT_EQ(ask(&e, &first), DRIVEID_OK);
    for (int k = 0; k < K / 2; k++) ASSERT_EQ(update(&e, 1e3 * r.y[k] + k, -r.u[k]), DRIVEID_NOT_YET);  // no motion of this plant
    restart(&e);
    ASSERT_EQ(ask(&e, &second), DRIVEID_OK);  // what was found stays
    EXPECT_EQ(second.blocks, 1u);
    EXPECT_EQ(second.theta[0], first.theta[0]);
    for (int k = 0; k < K; k++) ASSERT_EQ(update(&e, r.y[k], r.u[k]), k + 1 < K ? DRIVEID_NOT_YET : DRIVEID_OK) << k;  // a whole block from here
    ASSERT_EQ(ask(&e, &second), DRIVEID_OK);
    EXPECT_EQ(second.blocks, 2u);
    for (uint32_t i = 0; i < second.params; i++) EXPECT_EQ(second.theta[i], first.theta[i]) << i;  // to the last bit: nothing is left over
}

TEST(FliessOrders, ABlockBegunAnewKeepsNothingOfTheLostOne) {
    begun_anew<driveid_discrete_f64>(driveid_discrete_configure_f64, driveid_discrete_update_f64, driveid_discrete_estimate_f64, driveid_discrete_restart_block_f64);
    begun_anew<driveid_discrete_f32>(driveid_discrete_configure_f32, driveid_discrete_update_f32, driveid_discrete_estimate_f32, driveid_discrete_restart_block_f32);
}
