// SPDX-License-Identifier: Apache-2.0
// A known skew taken out: ramps come out exact whatever the stamps, nothing is joined across a silence, nothing is invented at the ends.
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "drive/shift.hpp"

using namespace gw;

namespace {

constexpr int64_t kMs = 1000000;
constexpr uint32_t kI = 1u << DRIVEID_SIGNAL_I_A;

// i(t) = 3 + 2 t, theta(t) = 7 t; the reading with stamp t is that of t - skew.
driveid_sample reading(int64_t t_ns, int64_t skew_ns) {
    driveid_sample s{};
    s.stamp = {t_ns, 5, DRIVEID_CLOCK_KERNEL};
    s.present = kI | 1u << DRIVEID_SIGNAL_THETA_RAD;
    s.value[DRIVEID_SIGNAL_I_A] = 3 + 2e-9 * double(t_ns - skew_ns);
    s.value[DRIVEID_SIGNAL_THETA_RAD] = 7e-9 * double(t_ns);
    return s;
}

void expect_right(const driveid_sample& s) {
    EXPECT_NEAR(s.value[DRIVEID_SIGNAL_I_A], 3 + 2e-9 * double(s.stamp.t_ns), 1e-12);
    EXPECT_EQ(s.value[DRIVEID_SIGNAL_THETA_RAD], 7e-9 * double(s.stamp.t_ns));
    EXPECT_EQ(s.stamp.err_ns, 5);
}

TEST(Shift, EitherSignBelowAndAboveASampleTimeAtUnevenStamps) {
    for (int64_t skew : {-7900000, -1500000, -1000000, -300000, 1, 300000, 1000000, 2700000, 7900000}) {
        std::mt19937 random(3);
        Shifter shifter(skew, kI, 50 * kMs);
        int64_t t = 1000 * kMs, last = 0;
        int in = 0, out = 0;
        for (; in < 500; ++in) {
            t += kMs * 8 / 10 + random() % (kMs * 4 / 10);
            shifter.add(reading(t, skew), [&](const driveid_sample& s) {
                expect_right(s);
                EXPECT_GT(s.stamp.t_ns, last);
                last = s.stamp.t_ns;
                ++out;
            });
        }
        EXPECT_GE(out, in - 10) << skew;
        EXPECT_LE(t - last, std::max<int64_t>(skew, 0) + 2 * kMs) << "no older than it must be";
    }
}

// 8 ms of skew at 64 kHz are more samples than are kept: those that had to go are counted, the others are right.
TEST(Shift, WhatComesTooDenselyIsCounted) {
    const int64_t skew = 8 * kMs, step = kMs / 64;
    Shifter shifter(skew, kI, 50 * kMs);
    int out = 0;
    for (int k = 0; k < 5000; ++k) shifter.add(reading(1000 * kMs + k * step, skew), [&](const driveid_sample& s) { expect_right(s), ++out; });
    EXPECT_GT(shifter.lost(), 4000u);
    EXPECT_LE(uint64_t(out) + shifter.lost(), 5000u);
    Shifter kept(skew, kI, 50 * kMs);
    for (int k = out = 0; k < 5000; ++k) kept.add(reading(1000 * kMs + k * kMs / 8, skew), [&](const driveid_sample& s) { expect_right(s), ++out; });
    EXPECT_EQ(kept.lost(), 0u);
    EXPECT_GT(out, 4900);
}

TEST(Shift, NoSkewChangesNothing) {
    Shifter shifter(0, kI, 50 * kMs);
    int out = 0;
    shifter.add(reading(kMs, 0), [&](const driveid_sample& s) { expect_right(s), ++out; });
    EXPECT_EQ(out, 1);
}

TEST(Shift, NothingIsJoinedAcrossASilenceOrAStepOfTheClock) {
    for (int64_t skew : {-400000, 400000}) {
        Shifter shifter(skew, kI, 5 * kMs);
        std::vector<int64_t> seen;
        const auto take = [&](const driveid_sample& s) { expect_right(s), seen.push_back(s.stamp.t_ns); };
        for (int k = 1; k <= 10; ++k) shifter.add(reading(k * kMs, skew), take);
        EXPECT_EQ(seen.size(), 9u);
        shifter.add(reading(16 * kMs, skew), take);            // after a silence of 6 ms
        EXPECT_EQ(seen.size(), 9u) << "one reading alone is no line";
        shifter.add(reading(17 * kMs, skew), take);
        EXPECT_EQ(seen.back(), skew > 0 ? 16 * kMs : 17 * kMs);
        shifter.add(reading(2 * kMs, skew), take);             // stamps went back
        shifter.add(reading(3 * kMs, skew), take);
        EXPECT_EQ(seen.back(), skew > 0 ? 2 * kMs : 3 * kMs);
        shifter.restart();
        shifter.add(reading(4 * kMs, skew), take);
        EXPECT_EQ(seen.size(), 11u);
    }
}

TEST(Shift, ASampleAtTheSilencesLengthIsStillJoined) {
    Shifter shifter(400000, kI, 5 * kMs);
    int out = 0;
    shifter.add(reading(kMs, 400000), [&](const driveid_sample&) { ++out; });
    shifter.add(reading(6 * kMs, 400000), [&](const driveid_sample& s) { expect_right(s), ++out; });
    EXPECT_EQ(out, 1);
}

TEST(Shift, AfterALongTimeItBeginsAnewAsAtFirst) {
    Shifter shifter(400000, kI, 5 * kMs);
    int out = 0;
    for (int k = 1; k <= 100; ++k) shifter.add(reading(k * kMs, 400000), [&](const driveid_sample&) { ++out; });
    EXPECT_EQ(out, 99);
    shifter.restart();
    for (int k = 1; k <= 100; ++k) shifter.add(reading(k * kMs, 400000), [&](const driveid_sample& s) { expect_right(s), ++out; });
    EXPECT_EQ(out, 198);
}

TEST(Shift, WhatIsNotMovedStays) {
    Shifter shifter(500000, 1u << DRIVEID_SIGNAL_V_V, 50 * kMs);
    driveid_sample got{};
    for (int k = 1; k < 5; ++k) shifter.add(reading(k * kMs, 0), [&](const driveid_sample& s) { got = s; });
    EXPECT_EQ(got.value[DRIVEID_SIGNAL_I_A], reading(got.stamp.t_ns, 0).value[DRIVEID_SIGNAL_I_A]);
}

// Values that lie on no line: each is between the two readings around its instant, and comes as soon as the second of them is there.
TEST(Shift, TheTwoReadingsAroundTheInstantAtOnce) {
    for (int64_t skew : {-2500000, -1000000, -250000, 750000, 1000000, 2250000}) {
        std::mt19937 random(9);
        std::vector<double> i;
        Shifter shifter(skew, kI, 50 * kMs);
        for (int k = 0; k < 200; ++k) {
            driveid_sample s = reading(k * kMs, 0);
            i.push_back(s.value[DRIVEID_SIGNAL_I_A] = double(random() % 1000));
            int came = 0;
            shifter.add(s, [&](const driveid_sample& out) {
                ++came;
                const double at = double(out.stamp.t_ns + skew) / kMs;
                const size_t a = size_t(at);
                const double part = at - double(a), expected = i[a] + (part > 0 ? part * (i[a + 1] - i[a]) : 0);
                ASSERT_NEAR(out.value[DRIVEID_SIGNAL_I_A], expected, 1e-9) << skew << " at " << k;
                EXPECT_EQ(out.stamp.t_ns, (k - (std::max<int64_t>(skew, 0) + kMs - 1) / kMs) * kMs);
            });
            EXPECT_EQ(came, k >= (std::llabs(skew) + kMs - 1) / kMs ? 1 : 0) << skew << " at " << k;
        }
    }
}

}  // namespace
