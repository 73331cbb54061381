// SPDX-License-Identifier: Apache-2.0
// Instants out of late arrivals: exact drives, arrivals late by a scheduler's whim, losses, silences.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "drive/pace.hpp"

namespace {

constexpr int64_t kPeriod = 1000000, kSilence = 60000000;

// Largest error after a settling time, for a drive whose clock is off by ppm and whose frames queue up behind pauses of the sender.
double worst_ns(double ppm, uint32_t seed, const std::vector<int>& lost = {}, int settle = 50) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(0, 1);
    gw::Pacer pacer(kPeriod, kSilence);
    double blocked_until = 0, worst = 0;
    int since_loss = 0;
    for (int k = 0; k < 20000; ++k) {
        const double sampled = 1e12 + k * kPeriod * (1 + ppm * 1e-6);
        if (uniform(random) < 0.02) blocked_until = std::max(blocked_until, sampled + 1e6 * (2 + 15 * uniform(random)));
        if (std::find(lost.begin(), lost.end(), k) != lost.end()) {
            since_loss = 0;
            continue;
        }
        const double arrival = std::max(sampled + 2e4 * uniform(random), blocked_until + 1e3 * uniform(random));
        blocked_until = std::max(blocked_until, arrival);
        const int64_t got = pacer.instant(int64_t(arrival));
        if (k > settle && ++since_loss > 40) worst = std::max(worst, std::abs(double(got) - sampled));
    }
    return worst;
}

TEST(Pace, InstantsOfADriveWhoseFramesWaitBehindPauses) {
    // Arrivals are late by up to 17 ms; 0.2 ms is what 200 ppm may run up during the longest jam, and the unloaded delay of 0.02 ms.
    for (uint32_t seed = 1; seed <= 20; ++seed)
        for (double ppm : {-50.0, 0.0, 50.0}) EXPECT_LT(worst_ns(ppm, seed), 2e5) << "seed " << seed << ", " << ppm << " ppm";
}

TEST(Pace, ALossIsBelievedAfterARow) {
    gw::Pacer pacer(kPeriod, kSilence);
    int64_t t = 5000000000, got = 0;
    for (int k = 0; k < 100; ++k) got = pacer.instant(t += kPeriod);
    EXPECT_EQ(got, t);
    t += 3 * kPeriod;  // three samples lost
    for (int k = 0; k < 9; ++k) got = pacer.instant(t += kPeriod);  // the first ends the hole
    EXPECT_EQ(got, t) << "after eight steady arrivals";
}

TEST(Pace, TheDrivesOwnCounterSaysHowManyPeriods) {
    // Polls that see one to four counts at a time, each up to three periods late: the instants are those of the counts.
    std::mt19937 random(7);
    gw::Pacer pacer(kPeriod, kSilence);
    int64_t count = 0;
    double worst = 0;
    for (int k = 0; k < 5000; ++k) {
        const int64_t step = 1 + random() % 4, sampled = (count += step) * kPeriod;
        const int64_t late = random() % 4 == 0 ? 20000 : random() % (3 * kPeriod);
        const int64_t got = pacer.instant(1000000000 + sampled + late, uint64_t(step));
        if (k > 50) worst = std::max(worst, std::abs(double(got - 1000000000 - sampled)));
    }
    EXPECT_LT(worst, 5e4);
}

TEST(Pace, AStepThatIsNotTheDrivesIsTorn) {
    // The first frame waited 8 ms and seven more with it; then they come on time.
    gw::Pacer pacer(kPeriod, kSilence);
    int torn = 0;
    int64_t last = 0;
    for (int k = 0; k < 2000; ++k) {
        const int64_t sampled = 1000000000 + k * kPeriod, arrival = std::max<int64_t>(sampled + 20000, 1008000000);
        const int64_t got = pacer.instant(arrival, 1);
        torn += pacer.torn();
        if (k > 0 && !pacer.torn()) {
            EXPECT_NEAR(double(got - last), double(kPeriod), 0.5 * kPeriod) << k;
        }
        if (k > 20) {
            EXPECT_NEAR(double(got), double(sampled), 5e4) << k;
        }
        last = got;
    }
    EXPECT_GE(torn, 1);
    EXPECT_LE(torn, 11);  // at least a quarter period a step: 8 ms are made up by 0.75 ms each
}

TEST(Pace, SilenceBeginsAnewAndTimeNeverRunsBack) {
    gw::Pacer pacer(kPeriod, kSilence);
    int64_t last = pacer.instant(1000);
    for (int64_t t : {1000000, 1000001, 1000002, 1000002, 90000000, 90000001}) {
        const int64_t got = pacer.instant(t);
        EXPECT_GT(got, last);
        last = got;
    }
    EXPECT_EQ(pacer.instant(200000000), 200000000);
}

}  // namespace
