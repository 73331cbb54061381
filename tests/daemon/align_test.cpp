// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive/align.hpp"

using namespace gw;

namespace {

constexpr uint32_t kI = 1u << DRIVEID_SIGNAL_I_A, kTheta = 1u << DRIVEID_SIGNAL_THETA_RAD, kT = 1u << DRIVEID_SIGNAL_T_DEGC;
constexpr int64_t kMs = 1000000;

struct Feed {
    explicit Feed(AlignOptions o) : aligner(o) {}
    bool add(uint32_t mask, double v, int64_t t_ns, int64_t err = 5) {
        double value[DRIVEID_SIGNAL_COUNT];
        for (auto& x : value) x = v;
        return aligner.add(mask, value, {t_ns, err, DRIVEID_CLOCK_KERNEL}, out);
    }
    Aligner aligner;
    driveid_sample out{};
};

AlignOptions two(int64_t tolerance = kMs / 2) {
    AlignOptions o;
    o.waited = kI | kTheta;
    o.tolerance_ns = tolerance;
    return o;
}

TEST(Align, OneSampleWithTheEarliestStampAndTheSpreadAsError) {
    Feed f(two());
    EXPECT_FALSE(f.add(kI, 1.5, 1000));
    EXPECT_TRUE(f.add(kTheta, 2.5, 1300));
    EXPECT_EQ(f.out.stamp.t_ns, 1000);
    EXPECT_EQ(f.out.stamp.err_ns, 300 + 5);
    EXPECT_EQ(f.out.present, kI | kTheta);
    EXPECT_EQ(f.out.value[DRIVEID_SIGNAL_I_A], 1.5);
    EXPECT_EQ(f.out.value[DRIVEID_SIGNAL_THETA_RAD], 2.5);
}

TEST(Align, EitherOrderAndALostMessage) {
    Feed f(two());
    f.add(kTheta, 0, 0 * kMs);
    EXPECT_TRUE(f.add(kI, 0, 0 * kMs + 100));
    f.add(kTheta, 1, 1 * kMs);                     // its current is lost
    EXPECT_FALSE(f.add(kTheta, 2, 2 * kMs));
    EXPECT_TRUE(f.add(kI, 2, 2 * kMs + 100));
    EXPECT_EQ(f.out.value[DRIVEID_SIGNAL_THETA_RAD], 2) << "never the angle of one instant with the current of another";
    EXPECT_EQ(f.aligner.counters().incomplete, 1u);
    EXPECT_EQ(f.aligner.counters().samples, 2u);
}

TEST(Align, TooFarApartIsNoSample) {
    Feed f(two());
    f.add(kI, 1, 0);
    EXPECT_FALSE(f.add(kTheta, 1, 900000));        // belongs to the next one: its current was lost
    EXPECT_TRUE(f.add(kI, 2, 1 * kMs));
    EXPECT_EQ(f.out.stamp.t_ns, 900000);
    EXPECT_EQ(f.aligner.counters().incomplete, 1u);
}

TEST(Align, TheToleranceIsStillInTime) {
    Feed f(two());
    f.add(kI, 1, 0);
    EXPECT_TRUE(f.add(kTheta, 1, kMs / 2));
    f.add(kI, 1, kMs);
    EXPECT_FALSE(f.add(kTheta, 1, kMs + kMs / 2 + 1));
    EXPECT_EQ(f.aligner.counters().incomplete, 1u);

    AlignOptions o = two();
    o.sync = DRIVEID_SIGNAL_I_A;
    Feed g(o);
    g.add(kTheta, 1, 0);
    EXPECT_TRUE(g.add(kI, 1, kMs / 2));
    g.add(kTheta, 1, kMs);
    EXPECT_FALSE(g.add(kI, 1, kMs + kMs / 2 + 1));
    EXPECT_EQ(g.aligner.counters().incomplete, 1u);
}

TEST(Align, OnlyManyLateSetsInARowAreANewTimeLine) {
    Feed f(two());
    auto set = [&](int64_t t) { f.add(kI, 0, t); return f.add(kTheta, 0, t); };
    EXPECT_TRUE(set(1000 * kMs));
    int late = 0;
    while (!set((10 + late) * kMs)) ASSERT_LT(++late, 1000);
    EXPECT_EQ(late, 19) << "the twentieth in a row";
    EXPECT_EQ(f.aligner.counters().late, uint64_t(late) + 1);
    EXPECT_TRUE(f.aligner.new_time_line());
    for (int k = 0; k < late; ++k) {                            // a set in time between them starts the count anew
        EXPECT_FALSE(set(kMs)) << k;
        if (k + 1 == late) {
            EXPECT_TRUE(set(5000 * kMs));
        }
    }
    for (int k = 0; k < late; ++k) EXPECT_FALSE(set(kMs)) << k;
}

TEST(Align, DuplicatesAndLateSets) {
    AlignOptions one;
    one.waited = kI, one.tolerance_ns = kMs;
    Feed f(one);
    EXPECT_TRUE(f.add(kI, 1, 10 * kMs));
    EXPECT_FALSE(f.add(kI, 1, 10 * kMs));
    EXPECT_FALSE(f.add(kI, 1, 9 * kMs));
    EXPECT_TRUE(f.add(kI, 1, 11 * kMs));
    EXPECT_EQ(f.aligner.counters().duplicates, 1u);
    EXPECT_EQ(f.aligner.counters().late, 1u);
    EXPECT_EQ(f.aligner.counters().samples, 2u);
    EXPECT_FALSE(f.aligner.new_time_line());
}

TEST(Align, StampsThatWentBackForGoodBeginANewTimeLine) {
    AlignOptions one;
    one.waited = kI, one.tolerance_ns = kMs;
    Feed f(one);
    EXPECT_TRUE(f.add(kI, 1, 3600 * INT64_C(1000000000)));  // one stamp an hour ahead
    int waited = 0;
    int64_t t = 0;
    while (!f.add(kI, 1, t += kMs)) ASSERT_LT(++waited, 100) << "a drive must not be deaf for an hour";
    EXPECT_TRUE(f.aligner.new_time_line());
    EXPECT_FALSE(f.aligner.new_time_line());
    EXPECT_TRUE(f.add(kI, 1, t += kMs));
}

TEST(Align, SyncClosesTheSampleWithWhatIsFresh) {
    AlignOptions o = two(kMs);
    o.sync = DRIVEID_SIGNAL_I_A;
    Feed f(o);
    f.add(kTheta, 1, 0);
    EXPECT_FALSE(f.add(kTheta, 2, kMs / 4));       // faster than the current: the last one counts
    EXPECT_TRUE(f.add(kI, 3, kMs / 2));
    EXPECT_EQ(f.out.value[DRIVEID_SIGNAL_THETA_RAD], 2);
    EXPECT_EQ(f.out.stamp.t_ns, kMs / 4);
    EXPECT_FALSE(f.add(kI, 4, kMs)) << "no new angle since";
    f.add(kTheta, 5, 2 * kMs);
    EXPECT_FALSE(f.add(kI, 5, 4 * kMs)) << "the angle is older than the tolerance";
    EXPECT_EQ(f.aligner.counters().incomplete, 2u);
}

TEST(Align, SlowSignalsAreUsedAsTheyStand) {
    AlignOptions o = two();
    o.others = kT;
    Feed f(o);
    f.add(kI, 1, 0);
    EXPECT_TRUE(f.add(kTheta, 1, 100));
    EXPECT_EQ(f.out.present, kI | kTheta);
    EXPECT_FALSE(f.add(kT, 40, kMs / 2));
    f.add(kI, 1, kMs);
    EXPECT_TRUE(f.add(kTheta, 1, kMs + 100));
    EXPECT_EQ(f.out.present, kI | kTheta | kT);
    EXPECT_EQ(f.out.value[DRIVEID_SIGNAL_T_DEGC], 40);
}

TEST(Align, NothingHalfSurvivesAGap) {
    Feed f(two());
    f.add(kI, 1, 0);
    f.aligner.restart();
    EXPECT_FALSE(f.add(kTheta, 1, 100));
    EXPECT_TRUE(f.add(kI, 2, 200));
    EXPECT_EQ(f.out.value[DRIVEID_SIGNAL_I_A], 2);
}

// A sync that found the set incomplete leaves nothing of it: the next one needs every value anew, the lowest signal too.
TEST(Align, NothingOfAnIncompleteSetIsLeftForTheNextSync) {
    AlignOptions o = two(kMs);
    o.waited |= 1u << DRIVEID_SIGNAL_V_V;
    o.sync = DRIVEID_SIGNAL_THETA_RAD;
    Feed f(o);
    f.add(kI, 1, 0);
    EXPECT_FALSE(f.add(kTheta, 1, 100)) << "no voltage";
    f.add(1u << DRIVEID_SIGNAL_V_V, 1, kMs / 2);
    EXPECT_FALSE(f.add(kTheta, 2, kMs / 2 + 100)) << "no current since";
    f.add(kI, 3, kMs);
    f.add(1u << DRIVEID_SIGNAL_V_V, 3, kMs);
    EXPECT_TRUE(f.add(kTheta, 3, kMs + 100));
    EXPECT_EQ(f.aligner.counters().incomplete, 2u);
}

}  // namespace
