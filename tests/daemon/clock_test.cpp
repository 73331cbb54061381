// SPDX-License-Identifier: Apache-2.0
#include <random>

#include <gtest/gtest.h>

#include "base/clock.hpp"

using namespace gw;

namespace {

constexpr int64_t kS = 1000000000, kWall = 1700000000 * kS;

TEST(RealtimeToMonotonic, ConvertsByAge) {
    RealtimeToMonotonic c;
    EXPECT_EQ(c.measure(100 * kS, kWall, 100 * kS + 200), 0);
    const auto s = c.convert(kWall - 5000);
    EXPECT_NEAR(double(s.t_ns), double(100 * kS + 100 - 5000), 1);
    EXPECT_GE(s.err_ns, 100);
    EXPECT_LE(s.err_ns, 200);
}

TEST(RealtimeToMonotonic, ASteppedClockNeverMovesStampsBackOrAhead) {
    for (int64_t step : {-3600 * kS, -2 * kS, 2 * kS, 3600 * kS}) {
        RealtimeToMonotonic c;
        c.measure(100 * kS, kWall, 100 * kS);
        // 10 ms later; the clock was stepped in between, and a frame was stamped before the step.
        const int64_t now = 100 * kS + 10000000;
        EXPECT_EQ(c.measure(now, kWall + 10000000 + step, now), step);
        const auto s = c.convert(kWall + 5000000);
        EXPECT_GE(s.t_ns, 100 * kS);
        EXPECT_LE(s.t_ns, now);
        const int64_t truth = 100 * kS + 5000000;
        EXPECT_LE(std::abs(s.t_ns - truth), s.err_ns) << "the bound holds";
        EXPECT_EQ(c.measure(now + kS, kWall + 10000000 + step + kS, now + kS), 0) << "told once";
        EXPECT_EQ(c.convert(kWall + 10000000 + step + kS - 1000).t_ns, now + kS - 1000);
    }
}

TEST(RealtimeToMonotonic, SlewingIsNoStep) {
    RealtimeToMonotonic c;
    int64_t wall = kWall;
    for (int64_t t = 0; t < 1000; ++t, wall += kS + 400000) EXPECT_EQ(c.measure((100 + t) * kS, wall, (100 + t) * kS), 0);  // 400 ppm
}

TEST(RealtimeToMonotonic, AnInterruptedReadingIsNoStepAndSpoilsNoStamp) {
    RealtimeToMonotonic c;
    c.measure(100 * kS, kWall, 100 * kS + 1000);
    // 30 ms pass between the first reading and the wall clock's, and none after it: the middle is 15 ms off.
    EXPECT_EQ(c.measure(101 * kS, kWall + kS + 30000000, 101 * kS + 30000000), 0);
    const auto s = c.convert(kWall + kS + 10000000);
    EXPECT_LE(std::abs(s.t_ns - (101 * kS + 10000000)), s.err_ns);
    EXPECT_LT(s.err_ns, 1000000);
}

TEST(HardwareToMonotonic, FollowsDriftAndTakesTheLeastLatency) {
    HardwareToMonotonic c;
    std::mt19937 random(4);
    double worst = 0;
    for (int k = 0; k < 100000; ++k) {
        const int64_t truth = 1000 * kS + k * INT64_C(1000000);
        const int64_t hardware = 77 * kS + int64_t(double(k) * 1e6 * (1 + 30e-6));  // own epoch, 30 ppm fast
        const int64_t software = truth + 20000 + int64_t(random() % 900000);        // 20 us to 0.92 ms of latency
        const auto s = c.convert(hardware, software);
        ASSERT_LE(s.t_ns, software);
        if (k > 2000) worst = std::max(worst, std::abs(double(s.t_ns - truth)));
    }
    // 20 us of latency are always there. The estimate leaks up 0.13 us a sample until a better one comes (chance x / 900 us):
    // an overshoot of y has probability exp(-y^2 / (2 * 0.13 us * 900 us)), 1e-12 a sample at 80 us.
    EXPECT_LT(worst, 100000);
}

TEST(HardwareToMonotonic, ARestartedCounterIsSeen) {
    HardwareToMonotonic c;
    c.convert(500 * kS, 1000 * kS);
    const auto s = c.convert(1 * kS, 1001 * kS);
    EXPECT_TRUE(c.reset_seen());
    EXPECT_EQ(s.t_ns, 1001 * kS);
}

}  // namespace
