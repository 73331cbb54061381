// SPDX-License-Identifier: Apache-2.0
// Method "frequency": frequencies and amplitudes of one and two sinusoids in noise, followed on line. Truth: the signal's own formula.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include <driveid/frequency.h>

namespace {

constexpr double kPi = 3.14159265358979323846, kDt = 1e-3;
constexpr const char *kType[] = {"f64", "f32", "q31"};

struct Tone {
    double f_Hz, amplitude;
};

// Phases run on when the frequency changes, as those of a machine do.
struct Source {
    Source(int seed, double sigma) : random(seed), noise(0, sigma), phase{1.0 + seed, 0.3} {}
    double next(const std::vector<Tone> &tones) {
        double y = 0.5 + noise(random);
        for (size_t i = 0; i < tones.size(); i++) {
            phase[i] += 2 * kPi * tones[i].f_Hz * kDt;
            y += tones[i].amplitude * std::sin(phase[i]);
        }
        return y;
    }
    std::mt19937_64 random;
    std::normal_distribution<double> noise;
    double phase[2];
};

struct Tracker {
    Tracker(uint32_t sinusoids, double highest_Hz, int type, double alarm = 0) {
        driveid_regression r;
        EXPECT_EQ(driveid_frequency_regression(sinusoids, 2 * kPi * highest_Hz, &r), DRIVEID_OK);
        driveid_estimator_options o{};
        o.dt_s = kDt, o.range[0] = 4, o.alarm = alarm;
        memory.resize(driveid_estimator_size("frequency", driveid_real(type)) / 8 + 1);
        char reason[300] = "";
        EXPECT_EQ(driveid_estimator_configure(get(), 8 * memory.size(), "frequency", driveid_real(type), &r, &o, reason, sizeof reason), DRIVEID_OK) << reason;
    }
    driveid_estimator *get() { return reinterpret_cast<driveid_estimator *>(memory.data()); }
    driveid_status feed(double y) { return driveid_estimator_update(get(), 1 + std::llround(1e9 * kDt * double(n++)), &y); }
    driveid_estimate answer() {
        driveid_estimate a{};
        status = driveid_estimator_estimate(get(), &a);
        if (status != DRIVEID_OK && status != DRIVEID_WEAK_EXCITATION) a.valid_mask = 0;
        return a;
    }
    std::vector<double> memory;
    long n = 0;
    driveid_status status = DRIVEID_OK;
};

bool inside(const driveid_estimate &a, int k, double truth) { return a.lo[k] <= truth && truth <= a.hi[k]; }

class Tones : public testing::TestWithParam<int> {};

// 20 seeds, answers 3, 9 and 15 s after the start: 95 % intervals hold in at least 53 of 60 (binomial, 99.9 %: 51), and are narrow.
TEST_P(Tones, OneInNoise) {
    int held_f = 0, held_a = 0, asked = 0;
    for (int seed = 1; seed <= 20; seed++) {
        const Tone tone{5 + 0.7 * seed, 0.3 + 0.02 * seed};
        Source source(seed, 0.03);
        Tracker tracker(1, 25, GetParam());
        for (int k = 1; k <= 15000; k++) {
            tracker.feed(source.next({tone}));
            if (k % 6000 != 3000) continue;
            const driveid_estimate a = tracker.answer();
            ASSERT_EQ(a.valid_mask, 3u) << seed << " at " << k;
            EXPECT_EQ(a.restarts, 0u) << seed;
            asked++, held_f += inside(a, 0, tone.f_Hz), held_a += inside(a, 1, tone.amplitude);
            if (k != 15000) continue;
            EXPECT_LT(a.hi[0] - a.lo[0], 0.04 * tone.f_Hz);
            EXPECT_LT(a.hi[1] - a.lo[1], (GetParam() == DRIVEID_Q31 ? 0.3 : 0.1) * tone.amplitude) << "in q31 the rounding widens f, and so what a wrong f may cost";
        }
    }
    EXPECT_EQ(asked, 60);
    EXPECT_GE(held_f, 53);
    EXPECT_GE(held_a, 53);
}

TEST_P(Tones, TwoInNoise) {
    int held[4] = {}, asked = 0;
    for (int seed = 1; seed <= 12; seed++) {
        const std::vector<Tone> tones{{6 + 0.2 * seed, 0.6}, {15 + 0.3 * seed, 0.4}};
        Source source(seed, 0.01);
        Tracker tracker(2, 20, GetParam());
        for (int k = 1; k <= 20000; k++) tracker.feed(source.next(tones));
        const driveid_estimate a = tracker.answer();
        ASSERT_EQ(a.valid_mask, 15u) << seed;
        asked++;
        for (int i = 0; i < 2; i++) held[2 * i] += inside(a, 2 * i, tones[i].f_Hz), held[2 * i + 1] += inside(a, 2 * i + 1, tones[i].amplitude);
    }
    for (int h : held) EXPECT_GE(h, 10) << "of " << asked;
}

// A new frequency is known again within 4 s (one memory to see it, half a second of hold, a window, a memory), with one restart; what is said to be valid
// from then on holds.
TEST_P(Tones, FrequencyChanges) {
    for (int seed = 1; seed <= 6; seed++)
        for (double factor : {0.7, 1.02, 1.5}) {
            const double f = 6 + 0.5 * seed;
            Source source(seed, 0.02);
            Tracker tracker(1, 20, GetParam());
            for (int k = 0; k < 8000; k++) tracker.feed(source.next({{f, 0.6}}));
            ASSERT_EQ(tracker.answer().valid_mask, 3u);
            for (int k = 0; k < 4000; k++) tracker.feed(source.next({{f * factor, 0.6}}));
            int held = 0, asked = 0;
            for (int k = 0; k < 4000; k++) {
                tracker.feed(source.next({{f * factor, 0.6}}));
                if (k % 400) continue;
                const driveid_estimate a = tracker.answer();
                EXPECT_EQ(a.valid_mask, 3u) << seed << " times " << factor << " at " << k;
                EXPECT_EQ(a.restarts, 1u);
                asked++, held += std::fabs(a.theta[0] - f * factor) <= a.hi[0] - a.lo[0];
            }
            EXPECT_EQ(held, asked) << seed << " times " << factor;
        }
}

TEST_P(Tones, VanishesAndComesBack) {
    for (int seed = 1; seed <= 6; seed++) {
        const Tone tone{7.3, 0.6};
        Source source(seed, 0.02);
        Tracker tracker(1, 20, GetParam());
        for (int k = 0; k < 8000; k++) tracker.feed(source.next({tone}));
        ASSERT_EQ(tracker.answer().valid_mask, 3u);
        for (int k = 0; k < 8000; k++) {
            tracker.feed(source.next({{tone.f_Hz, 0}}));
            if (k > 500 && k % 100 == 0) {  // within half a second
                EXPECT_EQ(tracker.answer().valid_mask, 0u) << seed << " " << k;
            }
        }
        for (int k = 0; k < 4000; k++) tracker.feed(source.next({tone}));
        const driveid_estimate a = tracker.answer();
        EXPECT_EQ(a.valid_mask, 3u) << seed;
        EXPECT_NEAR(a.theta[0], tone.f_Hz, a.hi[0] - a.lo[0]);
        EXPECT_NEAR(a.theta[1], tone.amplitude, a.hi[1] - a.lo[1]);
    }
}

TEST_P(Tones, NoiseAloneIsNoTone) {
    for (int seed = 1; seed <= 10; seed++) {
        Source source(seed, 0.2);
        Tracker tracker(1, 20, GetParam());
        for (int k = 0; k < 10000; k++) {
            tracker.feed(source.next({}));
            if (k % 500) continue;
            EXPECT_EQ(tracker.answer().valid_mask, 0u) << seed << " " << k;
        }
        EXPECT_EQ(tracker.answer().restarts, 0u);
    }
}

// A gap breaks the phases, not the frequency; lost and repeated stamps change nothing else.
TEST_P(Tones, GapsAndStrayStamps) {
    const Tone tone{9, 0.5};
    Source source(3, 0.01);
    Tracker tracker(1, 20, GetParam());
    for (int k = 0; k < 6000; k++) tracker.feed(source.next({tone}));
    const double before = tracker.answer().theta[0];
    tracker.n += 3000;
    EXPECT_EQ(tracker.feed(source.next({tone})), DRIVEID_GAP);
    EXPECT_NE(tracker.answer().valid_mask, 3u) << "amplitude from before the gap";
    for (int k = 0; k < 2000; k++) tracker.feed(source.next({tone}));
    const driveid_estimate a = tracker.answer();
    EXPECT_EQ(a.valid_mask, 3u);
    EXPECT_EQ(a.restarts, 0u);
    EXPECT_NEAR(a.theta[0], before, 0.02);
    tracker.n--;
    EXPECT_EQ(tracker.feed(0.5), DRIVEID_DUPLICATE);
    const double none = NAN;
    EXPECT_EQ(driveid_estimator_update(tracker.get(), 2 + std::llround(1e9 * kDt * double(tracker.n)), &none), DRIVEID_ERR_VALUE);
    EXPECT_EQ(tracker.answer().theta[0], a.theta[0]);
    driveid_estimator_restart(tracker.get());
    tracker.answer();
    EXPECT_EQ(tracker.status, DRIVEID_NOT_YET);
}

TEST_P(Tones, CopyIsASnapshot) {
    Source source(4, 0.02);
    Tracker tracker(1, 20, GetParam());
    for (int k = 0; k < 4000; k++) tracker.feed(source.next({{8, 0.5}}));
    Tracker copy = tracker;
    Source again = source;
    for (int k = 0; k < 2000; k++) tracker.feed(source.next({{8, 0.5}}));
    for (int k = 0; k < 2000; k++) copy.feed(again.next({{8, 0.5}}));
    EXPECT_EQ(std::memcmp(tracker.memory.data(), copy.memory.data(), 8 * tracker.memory.size()), 0);
}

INSTANTIATE_TEST_SUITE_P(Types, Tones, testing::Values(0, 1, 2), [](const auto &which) { return kType[which.param]; });

TEST(TonesFixed, CountsGiveTheSameBits) {
    Source source(5, 0.02);
    Tracker values(1, 20, 2), counts(1, 20, 2);
    for (int k = 0; k < 5000; k++) {
        const double y = source.next({{8, 0.5}});
        const int32_t count = int32_t(std::lrint(y / 4 * 1073741824.0));
        values.feed(y);
        driveid_estimator_update_counts(counts.get(), 1 + std::llround(1e9 * kDt * double(counts.n++)), &count);
    }
    const driveid_estimate a = values.answer(), b = counts.answer();
    EXPECT_EQ(a.valid_mask, 3u);
    EXPECT_EQ(std::memcmp(&a, &b, sizeof a), 0);
}

TEST(TonesOptions, NoRestartsWhereNoneAreWanted) {
    Source source(2, 0.02);
    Tracker tracker(1, 20, 0, -1);
    for (int k = 0; k < 6000; k++) tracker.feed(source.next({{7, 0.6}}));
    for (int k = 0; k < 6000; k++) tracker.feed(source.next({{11, 0.6}}));
    EXPECT_EQ(tracker.answer().restarts, 0u);
    EXPECT_EQ(tracker.answer().valid_mask, 0u);
}

TEST(TonesOptions, AnotherRegressionIsRefused) {
    driveid_regression r{};
    r.equations = r.channels = r.params = 1, r.terms = 2;
    r.term[0] = {0, 0, 2, DRIVEID_TERM_KNOWN, 1}, r.term[1] = {0, 0, 1, 0, 1};
    driveid_estimator_options o{};
    o.dt_s = kDt;
    std::vector<double> memory(driveid_estimator_size("frequency", DRIVEID_F64) / 8 + 1);
    char reason[300] = "";
    EXPECT_EQ(driveid_estimator_configure(reinterpret_cast<driveid_estimator *>(memory.data()), 8 * memory.size(), "frequency", DRIVEID_F64, &r, &o, reason, sizeof reason), DRIVEID_ERR_CONFIG);
    EXPECT_NE(std::string(reason).find("driveid_frequency_regression"), std::string::npos);
}

} // namespace
