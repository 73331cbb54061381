// SPDX-License-Identifier: Apache-2.0
// What driveid_fsm_suggest offers is nearly the best that there is: drawn oscillators, sample times and noise, against a grid of other settings.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>

#include "plants.hpp"
#include <driveid/fsm.h>

namespace {

struct Scene { // y'' + 2 zeta w y' + w^2 y = w^2 u, u a step, y and y' given at the start
    double w, zeta, y0, v0, dt_s, noise;
    double y(double t) const {
        const double decay = zeta * w, wd = w * std::sqrt(1 - zeta * zeta), a = y0 - 1, b = (v0 + decay * a) / wd;
        return 1 + std::exp(-decay * t) * (a * std::cos(wd * t) + b * std::sin(wd * t));
    }
};

// Root mean square error of w^2 and of b, relative, over seeds; three periods are recorded.
double error(const Scene &s, const driveid_fsm_config &config) {
    static driveid_fsm_f64 e;
    double sum = 0;
    const int seeds = 6;
    for (int seed = 1; seed <= seeds; seed++) {
        char reason[200];
        if (driveid_fsm_configure_f64(&e, &config, reason, sizeof reason)) return std::numeric_limits<double>::infinity();
        plants::Rng g(seed);
        for (int k = 0; k * s.dt_s < 3 * 6.28 / s.w; k++) driveid_fsm_update_f64(&e, llround(k * s.dt_s * 1e9), s.y(k * s.dt_s) + s.noise * plants::gauss(g), 1);
        driveid_fsm_estimate a;
        if (driveid_fsm_estimate_f64(&e, &a)) return std::numeric_limits<double>::infinity();
        sum += std::pow(a.a[0] / (s.w * s.w) - 1, 2) + std::pow(a.b[0] / (s.w * s.w) - 1, 2);
    }
    return std::sqrt(sum / 2 / seeds);
}

TEST(Shifting, SuggestionIsNearlyTheBest) {
    plants::Rng g(3);
    double worst = 0;
    for (int draw = 0; draw < 6; draw++) {
        const double w = plants::log_uniform(g, 5, 200);
        const Scene s{w, plants::uniform(g, 0.02, 0.4), plants::uniform(g, -1, 1), w * plants::uniform(g, -1, 1), plants::log_uniform(g, 0.02, 0.1) / w, draw % 3 == 0 ? 1e-4 : draw % 3 == 1 ? 3e-3 : 3e-2};
        driveid_fsm_config offered{};
        char reason[200] = "";
        offered.order = 2, offered.hold_u = DRIVEID_HOLD_ZERO;
        ASSERT_EQ(driveid_fsm_suggest(&offered, s.dt_s, s.w, s.noise, reason, sizeof reason), DRIVEID_OK) << reason;
        double best = 1e9;
        for (const int poles : {3, 5})
            for (const double pole : {1.0, 3.0, 8.0})
                for (const double share : {0.1, 0.5, 0.9}) {
                    driveid_fsm_config other = offered;
                    other.poles = uint8_t(poles), other.q_per_s = share * pole * s.w / 4;
                    for (int k = 0; k < poles; k++) other.pole_rad_s[k] = pole * s.w;
                    best = std::min(best, error(s, other));
                }
        const double mine = error(s, offered);
        std::printf("w %.0f rad/s, dt %.2g s, noise %g: %.3g %%, best of the grid %.3g %%\n", s.w, s.dt_s, s.noise, 100 * mine, 100 * best);
        worst = std::max(worst, mine / best);
    }
    EXPECT_LT(worst, 1.5);
}

TEST(Shifting, SuggestionKeepsToTheRules) {
    for (uint8_t order = 1; order <= DRIVEID_FSM_ORDER_MAX; order++)
        for (int zeros = 0; zeros <= order + 1; zeros++)
            for (const double noise : {0.0, 0.1}) {
                driveid_fsm_config c{};
                char reason[200] = "";
                c.order = order, c.zeros = uint8_t(zeros > order ? DRIVEID_FSM_AUTONOMOUS : zeros);
                ASSERT_EQ(driveid_fsm_suggest(&c, 1e-3, 30, noise, reason, sizeof reason), DRIVEID_OK) << int(order) << " " << zeros << " " << reason;
                static driveid_fsm_f32 e;
                EXPECT_EQ(driveid_fsm_configure_f32(&e, &c, reason, sizeof reason), DRIVEID_OK) << reason;
                EXPECT_LE(c.pole_rad_s[0] * 1e-3, 0.25);
            }
    driveid_fsm_config c{};
    char reason[200] = "";
    c.order = 2;
    EXPECT_EQ(driveid_fsm_suggest(&c, 0.1, 30, 0, reason, sizeof reason), DRIVEID_ERR_CONFIG);
    EXPECT_NE(std::string(reason).find("sample"), std::string::npos);
    EXPECT_EQ(driveid_fsm_suggest(&c, 0, 30, 0, reason, sizeof reason), DRIVEID_ERR_CONFIG);
    c.order = 9;
    EXPECT_EQ(driveid_fsm_suggest(&c, 1e-3, 30, 0, reason, sizeof reason), DRIVEID_ERR_CONFIG);
}

} // namespace
