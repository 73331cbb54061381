// SPDX-License-Identifier: Apache-2.0
// Sensors, motion, loops and the calibration of a case's size.
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "calibrate.hpp"
#include "case.hpp"
#include "effects.hpp"
#include "frames.hpp"

namespace {

sim::Setup setup_of(std::uint64_t seed, const std::string &structure, const std::vector<std::string> &effects = {"none"}) {
    sim::CaseRequest q;
    q.seed = seed; q.structure = structure; q.effects = effects; q.rate_Hz = 1000;
    return sim::draw_setup(q);
}

TEST(Record, EncoderReadsWholeCountsWithinHalfACount) {
    auto s = setup_of(3, "rigid_axis");
    s.sensors.has_q = true; s.sensors.sigma_q = 0;
    std::vector<sim::Reading> readings;
    const auto truth = sim::simulate(s, 0, 3, &readings);
    const double count = 2 * M_PI / s.drive.counts;
    for (std::size_t n = 0; n < truth.size(); ++n) {
        const double steps = readings[n].q / count;
        ASSERT_NEAR(steps, std::round(steps), 1e-6);
        ASSERT_LE(std::fabs(readings[n].q - truth[n].q), 0.5 * count * (1 + 1e-9));
    }
}

TEST(Record, NoiseHasItsSizeAndColour) {
    auto s = setup_of(4, "rigid_axis");
    s.sensors.average = false; s.sensors.sigma_i = 0.01; s.sensors.colour_i = 0.7;
    std::vector<sim::Reading> readings;
    const auto truth = sim::simulate(s, 0, 20, &readings);
    double power = 0, lagged = 0, last = 0;
    for (std::size_t n = 0; n < truth.size(); ++n) {
        const double e = readings[n].i - truth[n].i;
        power += e * e; lagged += e * last; last = e;
    }
    // 20,000 samples with correlation 0.7: about 3,500 independent ones, so 2.4 % standard error of the power; 5 sigma.
    EXPECT_NEAR(power / static_cast<double>(truth.size()), 1e-4, 0.12e-4);
    EXPECT_NEAR(lagged / power, 0.7, 0.04);
}

TEST(Record, LoopsFollowTheirReferenceInEveryStructure) {
    for (const char *structure : {"rigid_axis", "linear_axis", "dc_drive", "pmsm_drive"})
        for (std::uint64_t seed = 1; seed <= 6; ++seed) {
            auto s = setup_of(seed, structure);
            s.open_loop = false;
            const auto truth = sim::simulate(s, 0, 10, nullptr);
            double fastest = 0, far = 0;
            for (const auto &x : truth) { fastest = std::max(fastest, std::fabs(x.w)); far = std::max(far, std::fabs(x.q)); }
            EXPECT_GT(fastest, 0.25 * s.drive.w_max) << structure << " " << seed;
            EXPECT_LT(fastest, 1.6 * s.drive.w_max) << structure << " " << seed;
            EXPECT_LT(far, 2.5 * s.drive.range) << structure << " " << seed;
        }
}

TEST(Record, SameSeedSameBitsAndOtherSeedOtherDrive) {
    std::vector<sim::Reading> a, b;
    sim::simulate(setup_of(5, "pmsm_drive"), 0, 1, &a);
    sim::simulate(setup_of(5, "pmsm_drive"), 0, 1, &b);
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t n = 0; n < a.size(); ++n) { ASSERT_EQ(a[n].i, b[n].i); ASSERT_EQ(a[n].q, b[n].q); }
    EXPECT_NE(setup_of(5, "pmsm_drive").drive.J, setup_of(6, "pmsm_drive").drive.J);
}

TEST(Calibration, NothingHiddenLeavesNothing) {
    for (const char *structure : {"rigid_axis", "linear_axis", "pmsm_drive"})
        for (std::uint64_t seed = 1; seed <= 3; ++seed) {
            auto s = setup_of(seed, structure);
            std::vector<sim::Reading> readings;
            const auto truth = sim::simulate(s, 0, 12, &readings);
            const auto b = sim::weigh(s, truth, readings, false);
            EXPECT_LT(b.ratio(), 1.003) << structure << " " << seed;  // a third of the smallest size
        }
}

// The size is a statement about the record: with the true regressor the noisy residual falls to the floor, and without it stands at the ratio.
TEST(Calibration, ReachesItsRatioInTheNoisyRecord) {
    for (const char *effect : {"coulomb", "cogging", "compliance", "torque_saturation"})
        for (double ratio : {10.0, 1.2}) {
            auto s = setup_of(21, "rigid_axis", {effect});
            const auto c = sim::calibrate(s, effect, ratio, 12, {});
            EXPECT_NEAR(c.balance.ratio(), ratio, 0.03 * ratio) << effect;
            EXPECT_NEAR(c.balance.measured, ratio, 0.06 * ratio) << effect;
            EXPECT_GT(c.balance.significance, 15) << effect;
        }
}

TEST(Effects, EveryEntryChangesTheDriveAndOnlyTheNamedOnesExist) {
    std::set<std::string> names;
    int catalogue = 0;
    for (const auto &e : sim::effect_table()) {
        names.insert(e.name);
        catalogue += e.catalogue;
        const std::string structures = e.structures;
        auto s = setup_of(9, structures.substr(0, structures.find(' ')), {e.name});
        s.open_loop = false;
        const auto before = sim::simulate(s, 0, 4, nullptr);
        sim::add_effect(e.name, 1, s.drive, 4, 9, s.hidden);
        const auto after = sim::simulate(s, 0, 4, nullptr);
        bool differs = false;
        for (std::size_t n = 0; n < before.size(); ++n) {
            ASSERT_TRUE(std::isfinite(after[n].q_encoder) && std::isfinite(after[n].i)) << e.name;
            differs = differs || after[n].i != before[n].i || after[n].q_encoder != before[n].q_encoder;
        }
        EXPECT_TRUE(differs) << e.name;
    }
    EXPECT_EQ(catalogue, 23);
    EXPECT_EQ(names.size(), sim::effect_table().size());
    sim::Hidden x;
    EXPECT_THROW(sim::add_effect("coulomp", 1, sim::Drive{}, 1, 1, x), std::invalid_argument);
}

TEST(Frames, BitsOfEitherOrderStandWhereADbcSays) {
    std::uint8_t little[8] = {}, big[8] = {};
    sim::set_bits(little, 12, 8, false, 0xA5);  // bits 12..19
    EXPECT_EQ(little[1], 0x50);
    EXPECT_EQ(little[2], 0x0A);
    sim::set_bits(big, 11, 8, true, 0xA5);      // from bit 11 of byte 1 downwards, on to bit 23
    EXPECT_EQ(big[1], 0x0A);
    EXPECT_EQ(big[2], 0x50);
}

}  // namespace
