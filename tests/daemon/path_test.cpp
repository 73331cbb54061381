// SPDX-License-Identifier: Apache-2.0
// From frame to sample to estimate inside one drive: right values, exact accounting, no allocation.
#include <array>
#include <cmath>
#include <cstring>
#include <vector>

#include <gtest/gtest.h>

#include "allocations.hpp"
#include "control/describe.hpp"
#include "drive/drive.hpp"

using namespace gw;

namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kJ = 2e-4, kB = 1e-3, kKt = 0.05;

struct Ear final : DriveListener {
    void on_sample(int, const driveid_sample& s) override { last = s, ++samples; }
    void on_report(int) override { ++reports; }
    driveid_sample last{};
    int samples = 0, reports = 0;
};

const char* const kConfig = R"(
[[source]]
name = "bus"
kind = "socketcan"
interface = "vcan0"
[[drive]]
name = "axis1"
structure = "rigid_axis"
given = { K_t_Nm_A = 0.05 }
dt_s = 0.001
%s
  [[drive.signal]]
  name = "i_q_A"
  source = "bus"
  can_id = 0x181
  signed = true
  scale = 0.001
  hold = "zoh"
  %s
  [[drive.signal]]
  name = "theta_rad"
  source = "bus"
  can_id = 0x181
  start_bit = 16
  length = 32
  counts_per_turn = 1000000
  %s
  [drive.counter]
  source = "bus"
  can_id = 0x181
  start_bit = 48
  length = 8
)";

// The axis under piecewise constant current, solved exactly: w' = (K_t i - B w) / J.
struct Axis {
    double theta = 0, omega = 0, J = kJ;
    void step(double i_A, double dt) {
        const double a = kB / J, end = kKt * i_A / kB, e = std::exp(-a * dt);
        theta += end * dt + (omega - end) * (1 - e) / a;
        omega = end + (omega - end) * e;
    }
};

struct Rig {
    explicit Rig(const char* drive_keys = "", const char* theta_keys = "", const char* current_keys = "") {
        char text[2000];
        snprintf(text, sizeof text, kConfig, drive_keys, current_keys, theta_keys);
        ConfigResult r = config_read_text(text, "x.toml");
        EXPECT_TRUE(r.errors.empty()) << (r.errors.empty() ? "" : r.errors[0]);
        config = r.config;
        drive = std::make_unique<Drive>(config.drives[0], config, 0, ear);
    }
    // current held from this stamp to the next, angle at the stamp
    Fate send(int64_t t_ns, double i_A, double theta, int len = 8) {
        canfd_frame f{};
        f.can_id = 0x181, f.len = uint8_t(len);
        const int16_t i = int16_t(std::lround(i_A * 1000));
        const uint32_t counts = uint32_t(int64_t(std::floor(theta / (2 * kPi) * 1e6)));
        memcpy(f.data, &i, 2);
        memcpy(f.data + 2, &counts, 4);
        f.data[6] = counter++;
        return drive->frame(0, f, false, {t_ns, 1000, DRIVEID_CLOCK_KERNEL});
    }
    void run(int n, double sign_of_period = 0.137) {
        for (int k = 0; k < n; ++k, ++now) {
            const double i = std::fmod(double(now) * 0.001, 2 * sign_of_period) < sign_of_period ? 2.0 : -1.5;
            send(start + now * 1000000, i, axis.theta);
            axis.step(i, 0.001);
        }
    }
    Ear ear;
    Config config;
    std::unique_ptr<Drive> drive;
    Axis axis;
    uint8_t counter = 0;
    int64_t start = 1000000000000, now = 0;
};

TEST(Path, IdentifiesTheAxis) {
    Rig rig;
    rig.run(8000);
    const int64_t t = rig.drive->last_ns();
    EXPECT_EQ(rig.drive->state(t), DriveState::valid);
    ASSERT_EQ(rig.drive->parameters().size(), 2u);
    for (const auto& p : rig.drive->parameters()) {
        const double truth = std::string(p.name) == "J_kgm2" ? kJ : kB;
        EXPECT_TRUE(rig.drive->valid(p, t)) << p.name;
        EXPECT_NEAR(p.value, truth, 0.02 * truth) << p.name;  // quantised encoder, 8 s
        EXPECT_LE(std::abs(p.value - truth), 1.5 * (p.hi - p.lo)) << p.name;
    }
    EXPECT_EQ(rig.ear.samples, 8000);
    EXPECT_NEAR(rig.ear.reports, 80, 1);
    EXPECT_NEAR(rig.drive->rate_Hz(), 1000, 1);
    EXPECT_FALSE(rig.drive->valid(rig.drive->parameters()[0], t + 2000000000)) << "stale after stale_s of silence";
    EXPECT_EQ(rig.drive->state(t + 2000000000), DriveState::stale);
}

// Nothing watches: the residual alarm alone tells of the change, and is survived.
TEST(Path, AChangeOfLoadIsFollowedWithoutAWatch) {
    Rig rig("watch = false");
    rig.run(8000);
    rig.axis.J *= 1.5;
    rig.run(8000);
    EXPECT_GE(rig.drive->restarts(), 1u);
    const ParameterReport& J = rig.drive->parameters()[0];
    EXPECT_TRUE(rig.drive->valid(J, rig.drive->last_ns()));
    EXPECT_NEAR(J.value, 1.5 * kJ, 0.02 * kJ);
}

// alarm below 0: whoever wants no restarts gets none, though the watch names the change.
TEST(Path, NothingBeginsAnewWhereThatIsNotWanted) {
    Rig rig("alarm = -1");
    rig.run(8000);
    rig.axis.J *= 1.5;
    rig.run(12000);
    EXPECT_EQ(rig.drive->restarts(), 0u);
}

// The current's range is a fifth of what flows: what is bent by it is not called valid, and the count says why.
TEST(Path, FixedPointBeyondItsRangeIsNotTrusted) {
    Rig fits("type = \"q31\"", "range = 100", "range = 4"), small("type = \"q31\"", "range = 100", "range = 0.4");
    for (Rig* rig : {&fits, &small}) rig->run(8000);
    EXPECT_EQ(fits.drive->counters().saturations, 0u);
    EXPECT_EQ(fits.drive->state(fits.drive->last_ns()), DriveState::valid);
    EXPECT_GT(small.drive->counters().saturations, 1000u);
    for (const auto& p : small.drive->parameters()) EXPECT_FALSE(small.drive->valid(p, small.drive->last_ns())) << p.name << " " << p.value;
}

TEST(Path, AllocatesNothingOnceStarted) {
    Rig rig;
    JsonOut json;
    rig.run(200);
    const size_t before = allocations();
    for (int k = 0; k < 30; ++k) {
        rig.run(100);
        json.clear();
        describe_estimate(json, *rig.drive, rig.drive->last_ns());
        json.clear();
        describe_sample(json, *rig.drive, rig.ear.last);
    }
    rig.drive->gap(0, 3);
    rig.run(100);
    EXPECT_EQ(allocations(), before);
}

TEST(Path, ShortAndForeignFramesChangeNothing) {
    Rig rig;
    rig.run(100);
    const int samples = rig.ear.samples;
    EXPECT_EQ(rig.send(rig.start + rig.now * 1000000, 1, 0, 5), Fate::rejected) << "too short for the angle";
    canfd_frame f{};
    f.can_id = 0x182, f.len = 8;
    EXPECT_EQ(rig.drive->frame(0, f, false, {rig.start + 1, 0, DRIVEID_CLOCK_KERNEL}), Fate::unused);
    f.can_id = 0x181 | CAN_RTR_FLAG;
    EXPECT_EQ(rig.drive->frame(0, f, false, {rig.start + 1, 0, DRIVEID_CLOCK_KERNEL}), Fate::rejected);
    f.can_id = 0x181;
    EXPECT_EQ(rig.drive->frame(0, f, true, {rig.start + 1, 0, DRIVEID_CLOCK_KERNEL}), Fate::unused) << "29 bits";
    EXPECT_EQ(rig.drive->frame(1, f, false, {rig.start + 1, 0, DRIVEID_CLOCK_KERNEL}), Fate::unused) << "another bus";
    EXPECT_EQ(rig.ear.samples, samples);
    EXPECT_EQ(rig.drive->counters().rejected, 2u);
}

TEST(Path, TheCounterTellsLossRepetitionAndReorderingApart) {
    Rig rig;
    const auto send = [&](uint8_t counter, int64_t at) {
        rig.counter = counter;
        rig.send(rig.start + at * 1000000, 1, 0);
    };
    for (int k = 0; k < 300; ++k) send(uint8_t(k), k);  // wraps once
    EXPECT_EQ(rig.drive->counters().dropped, 0u);
    send(43, 300);                                       // last was 299 - 256 = 43: again
    EXPECT_EQ(rig.drive->counters().duplicates, 1u);
    send(47, 304);                                       // 44, 45, 46 are lost
    EXPECT_EQ(rig.drive->counters().dropped, 3u);
    send(45, 305);                                       // one of them comes late
    EXPECT_EQ(rig.drive->counters().reordered, 1u);
    EXPECT_EQ(rig.ear.samples, 301);
}

TEST(Path, FramesThatTheKernelDroppedAreAGapForTheEstimator) {
    Rig rig;
    rig.run(4000);
    const driveid_estimate before = rig.drive->estimate();
    rig.axis.theta += 300;  // the drive moved on while three frames were lost: no trajectory joins the two ends
    rig.now += 3;
    rig.drive->gap(0, 3);
    rig.run(4000);
    EXPECT_EQ(rig.drive->counters().gaps, 1u);
    EXPECT_EQ(rig.drive->estimate().restarts, before.restarts) << "not an alarm";
    EXPECT_NEAR(rig.drive->parameters()[0].value, kJ, 0.01 * kJ);
}

TEST(Path, AnEncoderResetIsAJumpNotAMove) {
    Rig rig("", "max_rate = 5000");
    rig.run(4000);
    const double before = rig.ear.last.value[DRIVEID_SIGNAL_THETA_RAD];
    rig.axis.theta = 0;
    rig.run(1);
    EXPECT_EQ(rig.ear.last.value[DRIVEID_SIGNAL_THETA_RAD], before);
    EXPECT_EQ(rig.drive->counters().jumps, 1u);
    EXPECT_GE(rig.drive->counters().gaps, 1u);
    rig.run(4000);
    for (const auto& p : rig.drive->parameters()) {
        const double truth = std::string(p.name) == "J_kgm2" ? kJ : kB;
        EXPECT_TRUE(!rig.drive->valid(p, rig.drive->last_ns()) || std::abs(p.value - truth) < 0.05 * truth) << p.name << " " << p.value;
    }
}

TEST(Path, KernelDropsAreAGap) {
    Rig rig;
    rig.run(100);
    rig.drive->gap(0, 7);
    EXPECT_EQ(rig.drive->counters().dropped, 7u);
    EXPECT_EQ(rig.drive->counters().gaps, 1u);
    rig.drive->gap(1, 7);
    EXPECT_EQ(rig.drive->counters().gaps, 1u) << "of a source that it does not use";
}

TEST(Path, StampsAnHourAheadDoNotDeafenIt) {
    Rig rig;
    rig.run(3000);
    const int64_t back = rig.start;
    rig.start += 3600 * INT64_C(1000000000);
    rig.run(1);
    rig.start = back;
    rig.run(6000);
    EXPECT_EQ(rig.drive->state(rig.drive->last_ns()), DriveState::valid);
    EXPECT_LT(std::abs(rig.drive->last_ns() - (rig.start + rig.now * 1000000)), 2000000);
}

TEST(Path, SyncFrameIsTheInstant) {
    Rig rig("instant_can_id = 0x80");
    canfd_frame sync{};
    sync.can_id = 0x80;
    for (int k = 0; k < 10; ++k) {
        const int64_t t = rig.start + k * 1000000;
        EXPECT_EQ(rig.drive->frame(0, sync, false, {t, 0, DRIVEID_CLOCK_KERNEL}), Fate::used);
        rig.send(t + 300000 + k * 17000, 0, 0);
        EXPECT_EQ(rig.ear.last.stamp.t_ns, t);
    }
    EXPECT_LT(rig.drive->jitter_ns(), 1);
}

TEST(Path, ASnapshotGoesOnBitForBit) {
    Rig a;
    a.run(3000);
    Ear ear;
    Drive copy(a.config.drives[0], a.config, 0, ear);
    ASSERT_TRUE(copy.same_model(*a.drive));
    copy.take(*a.drive);
    Rig b;  // the same frames again, to feed the copy with
    b.run(3000);
    b.drive = std::make_unique<Drive>(a.config.drives[0], a.config, 0, ear);
    b.drive->take(copy);
    a.run(2000);
    b.run(2000);
    for (size_t k = 0; k < a.drive->parameters().size(); ++k) {
        EXPECT_EQ(a.drive->parameters()[k].value, b.drive->parameters()[k].value);
        EXPECT_EQ(a.drive->parameters()[k].lo, b.drive->parameters()[k].lo);
    }
}

TEST(Path, AValueOfItsOwnAgeHasItsOwnStamp) {
    Rig rig("", "delay_s = 0.001");
    rig.send(rig.start, 1.5, 0.0);
    rig.send(rig.start + 1000000, 2.5, 0.1);  // its angle was taken when the current before it was
    ASSERT_EQ(rig.ear.samples, 1);
    EXPECT_EQ(rig.ear.last.stamp.t_ns, rig.start);
    EXPECT_DOUBLE_EQ(rig.ear.last.value[DRIVEID_SIGNAL_I_Q_A], 1.5);
    EXPECT_NEAR(rig.ear.last.value[DRIVEID_SIGNAL_THETA_RAD], 0.1, 1e-5);
}

TEST(Path, RepliesAreCountedByTheirCounterAndAJumpIsAGap) {
    const ConfigResult r = config_read_text(
        "[[source]]\nname = \"plc\"\nkind = \"modbus_tcp\"\nhost = \"127.0.0.1\"\nunit = 1\n[[drive]]\nname = \"a\"\nstructure = \"rigid_axis\"\ngiven = { K_t_Nm_A = 0.05 }\ndt_s = 0.001\n"
        "  [[drive.signal]]\n  name = \"i_q_A\"\n  source = \"plc\"\n  address = 1\n  encoding = \"i16\"\n"
        "  [[drive.signal]]\n  name = \"theta_rad\"\n  source = \"plc\"\n  address = 2\n  counts_per_turn = 1000\n  max_rate = 100\n"
        "  [drive.counter]\n  source = \"plc\"\n  address = 0\n  encoding = \"u16\"\n", "x.toml");
    ASSERT_TRUE(r.errors.empty()) << r.errors[0];
    Ear ear;
    Drive drive(r.config.drives[0], r.config, 0, ear);
    const auto reply = [&](uint16_t counter, int16_t i, uint16_t counts, int64_t ms) {
        ModbusReply m{};
        m.unit = 1, m.function = 4, m.count = 3;
        m.registers[0] = counter, m.registers[1] = uint16_t(i), m.registers[2] = counts;
        return drive.reply(0, m, {1000000000 + ms * 1000000, 0, DRIVEID_CLOCK_DAEMON});
    };
    EXPECT_EQ(reply(7, -2, 500, 0), Fate::used);
    EXPECT_DOUBLE_EQ(ear.last.value[DRIVEID_SIGNAL_I_Q_A], -2);
    EXPECT_NEAR(ear.last.value[DRIVEID_SIGNAL_THETA_RAD], kPi, 1e-12);
    EXPECT_EQ(reply(7, -3, 501, 1), Fate::used);
    EXPECT_EQ(ear.samples, 1) << "polled twice, sampled once";
    EXPECT_EQ(drive.counters().duplicates, 1u);
    EXPECT_EQ(reply(9, -3, 501, 2), Fate::used);
    EXPECT_EQ(drive.counters().dropped, 0u) << "a poll sees only some counts";
    EXPECT_EQ(reply(10, -3, 800, 3), Fate::used);
    EXPECT_EQ(drive.counters().jumps, 1u);
    EXPECT_EQ(drive.counters().gaps, 1u);
    EXPECT_EQ(drive.counters().dropped, 0u) << "a jump loses nothing";
    EXPECT_EQ(reply(10, -3, 800, 4), Fate::used);
    ModbusReply other{};
    other.unit = 2, other.function = 4, other.count = 3;
    EXPECT_EQ(drive.reply(0, other, {2000000000, 0, DRIVEID_CLOCK_DAEMON}), Fate::unused) << "another unit";
    EXPECT_EQ(drive.reply(1, other, {2000000000, 0, DRIVEID_CLOCK_DAEMON}), Fate::unused) << "another source";
}


struct Fields {
    explicit Fields(const std::string& keys, const std::string& signals) {
        ConfigResult r = config_read_text("[[source]]\nname = \"bus\"\nkind = \"socketcan\"\ninterface = \"vcan0\"\n[[source]]\nname = \"plc\"\nkind = \"modbus_tcp\"\nhost = \"127.0.0.1\"\nunit = 1\n"
                                          "[[drive]]\nname = \"a\"\nstructure = \"rigid_axis\"\ngiven = { K_t_Nm_A = 0.05 }\ndt_s = 0.001\n" + keys + signals, "x.toml");
        EXPECT_TRUE(r.errors.empty()) << (r.errors.empty() ? "" : r.errors[0]);
        config = r.config;
        drive = std::make_unique<Drive>(config.drives[0], config, 0, ear);
    }
    Fate frame(uint32_t id, std::vector<uint8_t> data, int64_t t_us, int source = 0) {
        canfd_frame f{};
        f.can_id = id, f.len = uint8_t(data.size());
        std::copy(data.begin(), data.end(), f.data);
        return drive->frame(source, f, id & CAN_EFF_FLAG, {1000000000 + t_us * 1000, 0, DRIVEID_CLOCK_KERNEL});
    }
    Fate reply(uint16_t address, std::vector<uint16_t> registers, int64_t t_us, uint8_t function = 4, uint8_t unit = 1) {
        ModbusReply m{};
        m.unit = unit, m.function = function, m.address = address, m.count = uint16_t(registers.size());
        std::copy(registers.begin(), registers.end(), m.registers);
        return drive->reply(1, m, {1000000000 + t_us * 1000, 0, DRIVEID_CLOCK_DAEMON});
    }
    double i() const { return ear.last.value[DRIVEID_SIGNAL_I_Q_A]; }
    double theta() const { return ear.last.value[DRIVEID_SIGNAL_THETA_RAD]; }
    Ear ear;
    Config config;
    std::unique_ptr<Drive> drive;
};

std::string can(const char* name, const char* keys) { return std::string("  [[drive.signal]]\n  name = \"") + name + "\"\n  source = \"bus\"\n  " + keys + "\n"; }
std::string plc(const char* name, const char* keys) { return std::string("  [[drive.signal]]\n  name = \"") + name + "\"\n  source = \"plc\"\n  " + keys + "\n"; }

TEST(Path, TwoPagesOfOneMessageAreOneSample) {
    Fields f("", can("i_q_A", "can_id = 0x10\n  start_bit = 8\n  mux = { length = 8, value = 1 }") + can("theta_rad", "can_id = 0x10\n  start_bit = 8\n  mux = { length = 8, value = 2 }"));
    EXPECT_EQ(f.frame(0x10, {1, 7, 0}, 0), Fate::used);
    EXPECT_EQ(f.ear.samples, 0);
    EXPECT_EQ(f.frame(0x10, {2, 9, 0}, 100), Fate::used);
    EXPECT_EQ(f.ear.samples, 1);
    EXPECT_EQ(f.i(), 7);
    EXPECT_EQ(f.theta(), 9);
    EXPECT_EQ(f.frame(0x10, {3, 9, 0}, 200), Fate::used) << "a page of no interest";
    EXPECT_EQ(f.ear.samples, 1);
    EXPECT_EQ(f.frame(0x10, {1, 9}, 300), Fate::rejected);
}

TEST(Path, AValueOutOfItsLimitsRejectsTheWholeFrame) {
    Fields f("", can("i_q_A", "can_id = 0x10\n  max = 5") + can("theta_rad", "can_id = 0x10\n  start_bit = 16"));
    EXPECT_EQ(f.frame(0x10, {6, 0, 1, 0}, 0), Fate::rejected);
    EXPECT_EQ(f.ear.samples, 0);
    EXPECT_EQ(f.frame(0x10, {5, 0, 1, 0}, 1000), Fate::used);
    EXPECT_EQ(f.ear.samples, 1);
    EXPECT_EQ(f.drive->counters().rejected, 1u);
}

TEST(Path, AJumpInAFrameIsAGapOfNothingLost) {
    Fields f("", can("i_q_A", "can_id = 0x10") + can("theta_rad", "can_id = 0x10\n  start_bit = 16\n  max_rate = 1000"));
    EXPECT_EQ(f.frame(0x10, {1, 0, 1, 0}, 0), Fate::used);
    EXPECT_EQ(f.frame(0x10, {1, 0, 2, 0}, 1000), Fate::used);
    EXPECT_EQ(f.drive->counters().jumps, 0u) << "one in a millisecond is 1000 a second";
    EXPECT_EQ(f.frame(0x10, {1, 0, 9, 0}, 2000), Fate::used);
    EXPECT_EQ(f.drive->counters().jumps, 1u);
    EXPECT_EQ(f.drive->counters().gaps, 1u);
    EXPECT_EQ(f.drive->counters().dropped, 0u);
    EXPECT_EQ(f.ear.samples, 3);
}

TEST(Path, TheInstantIsTheFramesOfIdentifierZeroTooAndOnlyForOneSampleTime) {
    Fields f("instant_can_id = 0\n", can("i_q_A", "can_id = 0x10") + can("theta_rad", "can_id = 0x10\n  start_bit = 16"));
    EXPECT_EQ(f.frame(0, {}, 0), Fate::used);
    EXPECT_EQ(f.frame(0x10, {1, 0, 1, 0}, 999), Fate::used);
    EXPECT_EQ(f.ear.last.stamp.t_ns, 1000000000);
    EXPECT_EQ(f.frame(0x10, {1, 0, 1, 0}, 1000), Fate::used) << "a sample time after the mark it marks no more";
    EXPECT_EQ(f.ear.last.stamp.t_ns, 1000000000 + 1000000);
    EXPECT_EQ(f.frame(0 | CAN_EFF_FLAG, {}, 2000), Fate::unused) << "29 bits";
    EXPECT_EQ(f.frame(0x10, {1, 0, 1, 0}, 2500), Fate::used);
    EXPECT_EQ(f.ear.last.stamp.t_ns, 1000000000 + 2500000);
}

TEST(Path, RegistersAreReadWhereTheReplyHasThemAll) {
    Fields f("", plc("i_q_A", "address = 4\n  encoding = \"i32\"") + plc("theta_rad", "address = 6\n  encoding = \"u16\""));
    EXPECT_EQ(f.reply(4, {0, 7, 9}, 0), Fate::used);
    ASSERT_EQ(f.ear.samples, 1);
    EXPECT_EQ(f.i(), 7);
    EXPECT_EQ(f.theta(), 9);
    EXPECT_EQ(f.reply(2, {0, 0, 0, 8, 10, 0}, 1000), Fate::used) << "more on both sides";
    EXPECT_EQ(f.i(), 8);
    EXPECT_EQ(f.reply(5, {9}, 2000), Fate::unused) << "half of it";
    EXPECT_EQ(f.reply(4, {9}, 2000), Fate::unused);
    EXPECT_EQ(f.reply(5, {9, 11}, 2000), Fate::used) << "the angle alone";
    EXPECT_EQ(f.ear.samples, 2);
    EXPECT_EQ(f.reply(4, {0, 9}, 2100), Fate::used) << "and the current after it";
    EXPECT_EQ(f.ear.samples, 3);
    EXPECT_EQ(f.theta(), 11);
    EXPECT_EQ(f.reply(4, {0, 7, 9}, 3000, 3), Fate::unused) << "holding registers are another table";
    EXPECT_EQ(f.reply(4, {0, 7, 9}, 3000, 4, 2), Fate::unused) << "another unit";
    EXPECT_EQ(f.ear.samples, 3);
}

TEST(Path, HoldingRegistersAndTheirLimits) {
    Fields f("", plc("i_q_A", "address = 0\n  table = \"holding\"\n  max = 5") + plc("theta_rad", "address = 1\n  table = \"holding\"\n  max_rate = 1000"));
    EXPECT_EQ(f.reply(0, {1, 1}, 0), Fate::unused);
    EXPECT_EQ(f.reply(0, {1, 1}, 0, 3), Fate::used);
    EXPECT_EQ(f.reply(0, {6, 1}, 1000, 3), Fate::rejected);
    EXPECT_EQ(f.drive->counters().rejected, 1u);
    EXPECT_EQ(f.ear.samples, 1);
}

TEST(Path, ACounterOf64BitsCounts) {
    Fields f("", plc("i_q_A", "address = 4") + plc("theta_rad", "address = 5") + "  [drive.counter]\n  source = \"plc\"\n  address = 0\n  encoding = \"u64\"\n");
    for (uint16_t k = 0; k < 3; ++k) EXPECT_EQ(f.reply(0, {0, 0, 0, k, 1, 1}, 1000 * k), Fate::used);
    EXPECT_EQ(f.ear.samples, 3);
    EXPECT_EQ(f.reply(0, {0, 0, 0, 2, 1, 1}, 3000), Fate::used);
    EXPECT_EQ(f.ear.samples, 3);
    EXPECT_EQ(f.drive->counters().duplicates, 1u);
}

// Half of the counter's range ahead is ahead; one more is behind.
TEST(Path, ACounterIsBehindBeyondHalfItsRange) {
    const auto fates = [](uint8_t next) {
        Fields f("", can("i_q_A", "can_id = 0x10") + can("theta_rad", "can_id = 0x10\n  start_bit = 16") + "  [drive.counter]\n  source = \"bus\"\n  can_id = 0x10\n  start_bit = 32\n  length = 8\n");
        EXPECT_EQ(f.frame(0x10, {1, 0, 1, 0}, 0), Fate::rejected) << "too short for the counter";
        EXPECT_EQ(f.drive->counters().rejected, 1u);
        f.frame(0x10, {1, 0, 1, 0, 0}, 0);
        f.frame(0x10, {1, 0, 1, 0, next}, 1000);
        return std::array<uint64_t, 3>{f.drive->counters().reordered, f.drive->counters().dropped, uint64_t(f.ear.samples)};
    };
    EXPECT_EQ(fates(128), (std::array<uint64_t, 3>{0, 127, 2}));
    EXPECT_EQ(fates(129), (std::array<uint64_t, 3>{1, 0, 1}));
    EXPECT_EQ(fates(1), (std::array<uint64_t, 3>{0, 0, 2}));
}

// paced, with a counter: three counts on is three periods on, however late the frame.
TEST(Path, PacedByTheDrivesOwnCounter) {
    Fields f("paced = true\n", can("i_q_A", "can_id = 0x10") + can("theta_rad", "can_id = 0x10\n  start_bit = 16") + "  [drive.counter]\n  source = \"bus\"\n  can_id = 0x10\n  start_bit = 32\n  length = 8\n");
    f.frame(0x10, {1, 0, 1, 0, 0}, 0);
    f.frame(0x10, {1, 0, 1, 0, 1}, 1000);
    f.frame(0x10, {1, 0, 1, 0, 4}, 9000);
    EXPECT_NEAR(double(f.ear.last.stamp.t_ns - 1000000000), 4e6, 2e3);
}

// The first frames wait together for 8 ms: one gap, however many steps it takes to the true instants.
TEST(Path, ALateBurstIsOneGap) {
    Fields f("paced = true\n", can("i_q_A", "can_id = 0x10") + can("theta_rad", "can_id = 0x10\n  start_bit = 16") + "  [drive.counter]\n  source = \"bus\"\n  can_id = 0x10\n  start_bit = 32\n  length = 8\n");
    for (int k = 0; k < 40; ++k) f.frame(0x10, {1, 0, 1, 0, uint8_t(k)}, std::max(8000 + 20 * k, 1000 * k));
    EXPECT_EQ(f.drive->counters().gaps, 1u);
    EXPECT_NEAR(double(f.ear.last.stamp.t_ns - 1000000000), 39e6, 2e4);
}

// A skew of half a sample: the current between its two readings, with the angle's stamp.
TEST(Path, TheSkewIsTakenOut) {
    Fields f("skew_s = 0.0005\n", can("i_q_A", "can_id = 0x10") + can("theta_rad", "can_id = 0x10\n  start_bit = 16"));
    for (uint8_t k = 0; k < 4; ++k) f.frame(0x10, {uint8_t(10 * k), 0, k, 0}, 1000 * k);
    EXPECT_EQ(f.ear.samples, 3);
    EXPECT_DOUBLE_EQ(f.i(), 25);
    EXPECT_EQ(f.theta(), 2);
    EXPECT_EQ(f.ear.last.stamp.t_ns, 1000000000 + 2000000);
    f.drive->gap(0, 1);
    f.frame(0x10, {90, 0, 9, 0}, 9000);
    f.frame(0x10, {100, 0, 10, 0}, 10000);
    EXPECT_DOUBLE_EQ(f.i(), 95) << "nothing is joined across the gap";
    EXPECT_EQ(f.ear.samples, 4);
}


TEST(Path, SignalsInTwoMessagesAreJudgedEachByItsOwn) {
    Fields f("", can("i_q_A", "can_id = 0x11") + can("theta_rad", "can_id = 0x10"));
    EXPECT_EQ(f.frame(0x10, {1}, 0), Fate::rejected) << "too short for the second signal, which is in it";
    EXPECT_EQ(f.frame(0x10, {1, 0}, 0), Fate::used);
    EXPECT_EQ(f.frame(0x11, {2, 0}, 100), Fate::used);
    EXPECT_EQ(f.ear.samples, 1);
    EXPECT_EQ(f.i(), 2);
    EXPECT_EQ(f.theta(), 1);
    EXPECT_EQ(f.frame(0x12, {2, 0}, 200), Fate::unused);
}

TEST(Path, ACounterInsideTheReply) {
    Fields f("", plc("i_q_A", "address = 10") + plc("theta_rad", "address = 11") + "  [drive.counter]\n  source = \"plc\"\n  address = 12\n  encoding = \"u16\"\n");
    EXPECT_EQ(f.reply(10, {1, 1, 5}, 0), Fate::used);
    EXPECT_EQ(f.reply(10, {1, 1, 5}, 1000), Fate::used);
    EXPECT_EQ(f.drive->counters().duplicates, 1u);
    EXPECT_EQ(f.reply(10, {1, 1, 6}, 2000), Fate::used);
    EXPECT_EQ(f.ear.samples, 2);
}


// paced, without a counter: that samples were lost is seen from a steady row of late frames.
TEST(Path, PacedByTheFramesAlone) {
    Fields f("paced = true\n", can("i_q_A", "can_id = 0x10") + can("theta_rad", "can_id = 0x10\n  start_bit = 16"));
    for (int k = 0; k < 50; ++k) f.frame(0x10, {1, 0, 1, 0}, 1000 * k);
    for (int k = 53; k < 63; ++k) f.frame(0x10, {1, 0, 1, 0}, 1000 * k);
    EXPECT_EQ(f.ear.last.stamp.t_ns, 1000000000 + 62000000);
}

}  // namespace
