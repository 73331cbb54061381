// SPDX-License-Identifier: Apache-2.0
// The watch's low-pass against the filter bank's on finely sampled smooth columns; names where the sums tell nothing apart.
#include <cmath>
#include <cstring>
#include <memory>
#include <random>
#include <set>
#include <string>

#include <gtest/gtest.h>

extern "C" {
#include "estimate/model_watch_state.h"
}

namespace {

// Straight lines between samples 1/2000 apart are the smooth column; the samples' stamps are drawn, with a long hole now and then.
TEST(WatchFilter, IsTheBanksLowPassAtAnyStamps) {
    for (unsigned sections : {3u, 4u}) {
        const uint8_t hold[1] = {DRIVEID_HOLD_FIRST}, level[1] = {1};
        driveid_bank_f64 bank;
        driveid_bank_init_f64(&bank, 1, uint8_t(sections), 200, hold, level);
        auto f = std::make_unique<watch_filter>();
        watch_filter_init(f.get(), 7, sections, 200);
        std::mt19937 random(5);
        const auto column = [](double t, unsigned c) { return 2 + std::sin(30 * t + c) + 0.2 * std::sin(170 * t); };
        double t = 0, out[WATCH_COLUMNS], worst = 0;
        for (int k = 0; k < 20000; ++k) {
            const double x = column(t, 3);
            if (k == 0) {
                driveid_bank_start_f64(&bank, &x, nullptr);
                watch_filter_start(f.get());
            }
            for (unsigned c = 0; c < 7; ++c) f->last[c] = column(t, c);
            const int64_t dt_ns = 50000 + int64_t(random() % 400000);
            t += 1e-9 * double(dt_ns);
            const double next = column(t, 3);
            driveid_bank_step_f64(&bank, dt_ns, &next, nullptr);
            watch_filter_step(f.get(), dt_ns);
            for (unsigned c = 0; c < 7; ++c) f->last[c] = column(t, c);
            watch_filter_read(f.get(), out);
            if (k > 10) worst = std::max(worst, std::fabs(out[3] - driveid_bank_value_f64(&bank, 0, 0)));
        }
        EXPECT_LT(worst, 5e-4) << sections;  // (170 * 0.45 ms)^2 / 12 of 0.2: what a straight line misses
        EXPECT_GT(worst, 0);
    }
}

// A ramp is its own straight line: the answer is exact over steps far longer than the filter remembers.
TEST(WatchFilter, ARampIsExactOverLongSteps) {
    auto f = std::make_unique<watch_filter>();
    watch_filter_init(f.get(), 1, 4, 100);
    watch_filter_start(f.get());
    f->last[0] = 0;
    double t = 0, out[WATCH_COLUMNS];
    for (double dt : {0.001, 0.05, 0.0371, 0.09, 0.002, 0.2}) {
        t += dt;
        watch_filter_step(f.get(), int64_t(std::llround(dt * 1e9)));
        f->last[0] = 5 * t;
        watch_filter_read(f.get(), out);
    }
    EXPECT_NEAR(out[0], 5 * (t - 4 / 100.0), 1e-6);  // late by the times of the sections; three points of Gauss a part
}

struct Watched {
    std::unique_ptr<driveid_watch> w = std::make_unique<driveid_watch>();
    Watched() {
        driveid_model model;
        driveid_online online;
        driveid_model_init(&model, DRIVEID_STRUCTURE_RIGID_AXIS);
        driveid_model_give(&model, "K_t_Nm_A", 0.05);
        EXPECT_EQ(driveid_online_init(&online, &model, 1u << DRIVEID_SIGNAL_I_A | 1u << DRIVEID_SIGNAL_THETA_RAD, nullptr, 0), DRIVEID_OK);
        EXPECT_EQ(driveid_watch_init(w.get(), &online, 1e-3), DRIVEID_OK);
    }
    int candidate(const char *name, double order) const {
        for (int k = 0; k < w->candidates; ++k)
            if (!strcmp(driveid_effect_at(w->candidate[k].effect)->name, name) && w->candidate[k].order == order) return k;
        return -1;
    }
    // Sums in which these candidates, by their first column, take the same 90 % of the residual, and the others nothing.
    void alike(const std::set<int> &which) {
        const double rows = 1000, part = std::sqrt(0.9);
        w->weight = rows;
        w->bb[w->params][w->params] = rows;
        for (unsigned p = 0; p < w->params; ++p) w->bb[p][p] = rows;
        for (unsigned c = 0; c < w->columns; ++c) w->zz[0][c] = rows;
        for (int k : which) w->zb[w->params][w->candidate[k].first] = part * rows;
    }
};

TEST(Watch, AllCandidatesFindRoom) {
    const Watched b;
    EXPECT_GE(b.candidate("cogging", WATCH_ORDERS), 0);
    EXPECT_GE(b.candidate("torque_ripple", WATCH_ORDERS / 2), 0);
}

TEST(Watch, ASaidNameIsKnownToStayHoweverManyEffectsTie) {
    Watched b;
    std::set<int> which;
    for (const char *name : {"coulomb", "constant_load", "quadratic_drag", "asymmetric_friction", "gravity_unbalance", "load_dependent_friction"}) which.insert(b.candidate(name, 0));
    which.insert(b.candidate("cogging", 7));
    which.insert(b.candidate("cogging", 9));
    b.alike(which);
    const double theta[WATCH_BASE] = {};
    watch_finding f = watch_find(b.w.get(), theta);
    ASSERT_GE(f.best, 0);
    EXPECT_EQ(f.ties, unsigned(DRIVEID_WATCH_TIES));
    EXPECT_EQ(f.said, -1) << "nothing was said";
    for (int said : which) {
        b.w->said = said;
        f = watch_find(b.w.get(), theta);
        EXPECT_EQ(f.said, said);
        EXPECT_NEAR(f.said_share, 0.9, 1e-6);
    }
    b.w->said = b.candidate("cogging", 12);  // the same effect, its order is told apart
    f = watch_find(b.w.get(), theta);
    ASSERT_GE(f.said, 0);
    EXPECT_STREQ(driveid_effect_at(b.w->candidate[f.said].effect)->name, "cogging");
    b.w->said = b.candidate("torque_ripple", 5);
    EXPECT_EQ(watch_find(b.w.get(), theta).said, -1);
}

TEST(Watch, NothingIsFoundInAResidualThatNoCandidateTakes) {
    Watched b;
    b.alike({});
    const double theta[WATCH_BASE] = {};
    const watch_finding f = watch_find(b.w.get(), theta);
    EXPECT_EQ(f.best, -1);
    EXPECT_EQ(f.open, 0);
    EXPECT_DOUBLE_EQ(f.r2, 1);
}

}  // namespace
