// SPDX-License-Identifier: Apache-2.0
// A fleet gives each drive what the single estimator gives it, bit by bit: statuses and answers, through start, lost values, gaps, alarms and restarts.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "axis.hpp"
#include "plants.hpp"
#include <driveid/fleet.h>

namespace {

struct Fleet {
    std::vector<double> memory;
    driveid_fleet *get() { return reinterpret_cast<driveid_fleet *>(memory.data()); }
    Fleet(driveid_real type, const driveid_regression &r, const driveid_estimator_options &o, uint32_t drives) : memory(driveid_fleet_size(type, &r, &o, drives) / 8 + 1) {
        char reason[200] = "";
        EXPECT_EQ(driveid_fleet_configure(get(), memory.size() * 8, type, &r, &o, drives, reason, sizeof reason), DRIVEID_OK) << reason;
    }
};

// Stamps jitter a little; each drive has its own moves. Events: values that are no number, a told gap, a long silence, a jump of J, a restart, a
// duplicate and a backward stamp.
void compare(driveid_real type, uint32_t drives, int samples, bool events, double dt_s = 1e-3) {
    plants::Rng g(drives + 7);
    const int more = int(1e-3 / dt_s + 0.5);
    driveid_estimator_options o{};
    o.dt_s = dt_s;
    const driveid_regression r = plants::axis_regression();
    Fleet fleet(type, r, o, drives);
    std::vector<plants::AxisEstimator> single(drives, plants::AxisEstimator(o, "fsm", type));
    std::vector<plants::Axis> axis;
    for (uint32_t d = 0; d < drives; d++) axis.push_back({1e-4 * (1 + 0.1 * d), 1e-4 + 1e-5 * d}), axis.back().omega = d;
    std::vector<double> channel(2 * drives);
    std::vector<driveid_status> status(drives);
    int64_t t_ns = 1;
    unsigned seen = 0, alarms = 0;
    for (int k = 0; k < samples; k++) {
        const double t = k * dt_s;
        for (uint32_t d = 0; d < drives; d++) {
            if (events && k == samples / 2 && d % 3 == 1) axis[d].J *= 2;
            const bool rests = t > 0.7 * samples * dt_s && d % 2;
            if (rests) axis[d].omega = 0;
            const double tau = rests ? 0 : 1e-2 * (std::sin((5 + 0.1 * d) * t) + std::sin(13 * t));
            channel[d] = axis[d].theta + 1e-4 * plants::gauss(g), channel[drives + d] = tau;
            axis[d].step(tau, dt_s);
            if (events && (k + 37 * d) % (1501 * more) == 700) channel[d + (d % 2) * drives] = std::numeric_limits<double>::quiet_NaN();
            if (events && (k + 91 * d) % (2203 * more) == 1200) driveid_fleet_gap(fleet.get(), d), driveid_estimator_gap(single[d].get());
            if (events && d == 2 && k == samples / 3) driveid_fleet_restart(fleet.get(), d), driveid_estimator_restart(single[d].get());
        }
        ASSERT_EQ(driveid_fleet_update(fleet.get(), t_ns, channel.data(), status.data()), DRIVEID_OK);
        for (uint32_t d = 0; d < drives; d++) {
            const double x[2] = {channel[d], channel[drives + d]};
            const driveid_status s = driveid_estimator_update(single[d].get(), t_ns, x);
            ASSERT_EQ(status[d], s) << "drive " << d << " sample " << k;
            seen |= s < 0 ? 1u << 31 : 1u << s;
            if (k % 50 && k % 50 != 1) continue;
            driveid_estimate a{}, b{};
            ASSERT_EQ(driveid_fleet_estimate(fleet.get(), d, &a), driveid_estimator_estimate(single[d].get(), &b));
            ASSERT_EQ(std::memcmp(&a, &b, sizeof a), 0) << "drive " << d << " sample " << k << " J " << a.theta[0] << " " << b.theta[0];
            alarms += a.restarts;
        }
        const bool odd = events && k % (997 * more) == 500;
        if (odd && k % 2) t_ns -= 3 * int64_t(1e9 * dt_s); // runs back, then catches up
        else if (!odd) t_ns += int64_t(1e9 * dt_s) + (events ? int64_t(plants::uniform(g, -2e4, 2e4)) : 0);
        if (events && k < 0.7 * samples && k % (1777 * more) == 900) t_ns += 20 * int64_t(1e9 * dt_s);
    }
    EXPECT_TRUE(seen & 1u << DRIVEID_OK);
    if (!events) return;
    for (const unsigned bit : {31, int(DRIVEID_GAP), int(DRIVEID_DUPLICATE), int(DRIVEID_FROZEN)}) EXPECT_TRUE(seen & 1u << bit) << bit;
    EXPECT_GT(alarms, 0u);
}

TEST(Fleet, OneDrive) { compare(DRIVEID_F64, 1, 3000, false); }
TEST(Fleet, SixteenDrives) { compare(DRIVEID_F64, 16, 3000, false); }
TEST(Fleet, EventsF64) { compare(DRIVEID_F64, 13, 12000, true); }
TEST(Fleet, EventsF32) { compare(DRIVEID_F32, 13, 12000, true); }
TEST(Fleet, FourKilohertz) { compare(DRIVEID_F64, 5, 40000, true, 2.5e-4); }

TEST(Fleet, Refusals) {
    driveid_estimator_options o{};
    const driveid_regression r = plants::axis_regression();
    EXPECT_EQ(driveid_fleet_size(DRIVEID_F64, &r, &o, 4), 0u); // no dt_s
    o.dt_s = 1e-3;
    EXPECT_EQ(driveid_fleet_size(DRIVEID_Q31, &r, &o, 4), 0u);
    EXPECT_EQ(driveid_fleet_size(DRIVEID_F64, &r, &o, 0), 0u);
    std::vector<double> memory(driveid_fleet_size(DRIVEID_F64, &r, &o, 4) / 8);
    char reason[200];
    auto *f = reinterpret_cast<driveid_fleet *>(memory.data());
    EXPECT_EQ(driveid_fleet_configure(f, 1000, DRIVEID_F64, &r, &o, 4, reason, sizeof reason), DRIVEID_ERR_CAPACITY);
    EXPECT_NE(std::string(reason).find("driveid_fleet_size"), std::string::npos);
    EXPECT_EQ(driveid_fleet_configure(f, memory.size() * 8, DRIVEID_Q31, &r, &o, 4, reason, sizeof reason), DRIVEID_ERR_ARGUMENT);
    ASSERT_EQ(driveid_fleet_configure(f, memory.size() * 8, DRIVEID_F64, &r, &o, 4, reason, sizeof reason), DRIVEID_OK);
    driveid_estimate e;
    EXPECT_EQ(driveid_fleet_estimate(f, 4, &e), DRIVEID_ERR_ARGUMENT);
    EXPECT_EQ(driveid_fleet_estimate(f, 3, &e), DRIVEID_NOT_YET);
}

} // namespace
