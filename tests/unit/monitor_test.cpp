// SPDX-License-Identifier: Apache-2.0
// Residual monitor: silent on what is usual, quick on what is not. Known noise and motion.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include <driveid/monitor.h>

namespace {

struct World {
    std::mt19937_64 g{1};
    std::normal_distribution<double> normal;
    driveid_monitor m;
    double low = 0;
    World() { driveid_monitor_init(&m, 0); }
    // A row each 2.5 ms; residual is correlated noise plus a share of a drive that works 1 s in 3.
    int row(int k, double noise, double mismatch) {
        low += 0.1 * (normal(g) - low);
        const double drive = (k / 400) % 3 == 0 ? std::sin(0.03 * k) : 0;
        return driveid_monitor_feed(&m, noise * low / 0.23 + mismatch * drive, drive * drive, 0, 0.0025);
    }
};

TEST(Monitor, NoFalseAlarmInTwentyHours) {
    World w;
    int alarms = 0;
    for (int k = 0; k < 20 * 3600 * 400; k += 1) alarms += w.row(k, 0.01, 0.02); // a usual mismatch of 2 % belongs to the picture
    EXPECT_EQ(alarms, 0);
}

TEST(Monitor, SeesAChangeWithinHalfASecondOfMotion) {
    for (int seed = 1; seed <= 100; seed++) {
        World w;
        w.g.seed(seed);
        int k = 0;
        for (; k < 24000; k++) ASSERT_EQ(w.row(k, 0.002, 0), 0);
        int alarm = -1;
        for (int start = k; k < start + 200 && alarm < 0; k++)
            if (w.row(k, 0.002, 0.05)) alarm = k - start;
        EXPECT_GE(alarm, 0);
    }
}

TEST(Monitor, NegativeThresholdNeverAlarms) {
    World w;
    driveid_monitor_init(&w.m, -1);
    for (int k = 0; k < 10000; k++) EXPECT_EQ(w.row(k, k < 5000 ? 0.01 : 10, 0), 0);
}

} // namespace
