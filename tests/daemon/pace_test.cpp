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

// After a hole of 20 periods come arrivals at this spacing: are they believed within nine of them?
bool believed(double spacing, uint64_t periods = 0) {
    gw::Pacer pacer(kPeriod, kSilence);
    int64_t t = 5000000000, got = 0;
    for (int k = 0; k < 100; ++k) pacer.instant(t += kPeriod, periods);
    t += 20 * kPeriod;
    for (int k = 0; k < 9; ++k) got = pacer.instant(t += llround(spacing * kPeriod), periods);
    return got == t;
}

TEST(Pace, OnlyArrivalsAboutAPeriodApartAreARow) {
    for (double spacing : {0.51, 0.6, 1.0, 1.4, 1.49}) EXPECT_TRUE(believed(spacing)) << spacing;
    for (double spacing : {0.3, 0.4, 0.5, 1.5, 1.6, 2.0}) EXPECT_FALSE(believed(spacing)) << spacing;
    EXPECT_FALSE(believed(1.0, 1)) << "where a counter tells, it is believed and not the row";
}

// The row is of exactly eight, all late by half a period or more.
TEST(Pace, ARowHasEightArrivalsLateByHalfAPeriod) {
    const auto after = [](int64_t late_ns) {
        gw::Pacer pacer(kPeriod, kSilence);
        int64_t t = 5000000000;
        for (int k = 0; k < 100; ++k) pacer.instant(t += kPeriod);
        t += late_ns;
        for (int k = 1; k < 40; ++k)
            if (t += kPeriod; pacer.instant(t) == t) return k;
        return 40;
    };
    EXPECT_EQ(after(3 * kPeriod), 9) << "the first ends the hole";
    EXPECT_EQ(after(kPeriod * 6 / 10), 9) << "the first is 1.6 periods after the last";
    EXPECT_EQ(after(kPeriod * 45 / 100), 40) << "late by less: it is made up by 200 ppm alone";
}

TEST(Pace, ASilenceIsLongerThanItsLimitEitherWay) {
    gw::Pacer pacer(kPeriod, kSilence);
    int64_t t = pacer.instant(1000000000);
    EXPECT_LT(pacer.instant(t + kSilence), t + kSilence) << "just not";
    EXPECT_EQ(pacer.instant(t + 2 * kSilence + 1), t + 2 * kSilence + 1);
    EXPECT_GT(pacer.instant(t + kSilence + 1), t + 2 * kSilence) << "back, but not by more than a silence";
    EXPECT_EQ(pacer.instant(t - kSilence), t - kSilence) << "the stamps begin anew";
}

// An early arrival is followed at once, but never onto the last instant: a quarter of a period lies between two.
TEST(Pace, InstantsLieAQuarterOfAPeriodApartAtLeast) {
    gw::Pacer pacer(kPeriod, kSilence);
    const int64_t t = pacer.instant(1000000000);
    EXPECT_EQ(pacer.instant(t + 1), t + kPeriod / 4);
    EXPECT_EQ(pacer.instant(t + kPeriod / 4 + 400000), t + kPeriod / 4 + 400000);
}

// Anew after a silence: the row is counted from nothing there too.
TEST(Pace, ARowBeginsAnewAfterASilence) {
    gw::Pacer pacer(kPeriod, kSilence);
    int64_t t = 5000000000;
    for (int k = 0; k < 10; ++k) pacer.instant(t += kPeriod);
    pacer.instant(t += 2 * kSilence);
    t += kPeriod * 6 / 10;  // the next ones are all late by that
    int k = 1;
    while (k < 40) {
        t += kPeriod;
        if (pacer.instant(t) == t) break;
        ++k;
    }
    EXPECT_EQ(k, 9) << "the first is 1.6 periods after the last";
}

}  // namespace
