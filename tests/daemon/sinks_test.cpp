// SPDX-License-Identifier: Apache-2.0
// What is sent: never on an identifier that could move a drive; frames and registers as published; hostile Modbus requests.
#include <cstring>

#include <gtest/gtest.h>

#include "sink/layout.hpp"
#include "sink/make_sink.hpp"
#include "sink/modbus_server.hpp"

using namespace gw;

namespace {

struct Nobody final : DriveListener {
    void on_sample(int, const driveid_sample&) override {}
    void on_report(int) override {}
} nobody;

struct Built {
    explicit Built(const std::string& sinks, const std::string& extra = "") {
        const std::string text = R"(
[[source]]
name = "bus"
kind = "socketcan"
interface = "vcan0"
[[drive]]
name = "axis1"
structure = "rigid_axis"
given = { K_t_Nm_A = 0.05 }
dt_s = 0.001
)" + extra + R"(
  [[drive.signal]]
  name = "i_q_A"
  source = "bus"
  can_id = 0x181
  [[drive.signal]]
  name = "theta_rad"
  source = "bus"
  can_id = 0x182
  length = 32
  counts_per_turn = 65536
)" + sinks;
        ConfigResult r = config_read_text(text, "x.toml");
        errors = r.errors;
        config = r.config;
        if (!errors.empty()) return;
        drives.push_back(std::make_unique<Drive>(config.drives[0], config, 0, nobody));
        check_transmit(config, drives, errors);
    }
    Config config;
    std::vector<std::unique_ptr<Drive>> drives;
    std::vector<std::string> errors;
};

std::string can_sink(uint32_t id, bool extended = false) {
    return "[[sink]]\nname = \"out\"\nkind = \"can\"\nsource = \"bus\"\ndrive = \"axis1\"\ncan_id = " + std::to_string(id) + "\nextended = " + (extended ? "true" : "false") + "\n";
}

// CiA 301: what a node obeys. Two parameters are sent, so the identifier after the first counts too.
TEST(Transmit, RefusesEveryCanopenControlObject) {
    for (uint32_t node : {1u, 2u, 64u, 127u})
        for (uint32_t base : {0x200u, 0x300u, 0x400u, 0x500u, 0x600u}) EXPECT_FALSE(Built(can_sink(base + node)).errors.empty()) << std::hex << base + node;
    for (uint32_t id : {0x000u, 0x080u, 0x07Fu, 0x100u, 0x0FFu, 0x7E4u, 0x7E5u, 0x200u, 0x7FFu}) EXPECT_FALSE(Built(can_sink(id)).errors.empty()) << std::hex << id;
    for (uint32_t id : {0x5A0u, 0x700u, 0x7F0u, 0x190u, 0x680u}) EXPECT_TRUE(Built(can_sink(id)).errors.empty()) << std::hex << id;
}

TEST(Transmit, RefusesWhatItListensTo) {
    for (uint32_t id : {0x180u, 0x181u, 0x182u}) {
        const Built b(can_sink(id));
        ASSERT_FALSE(b.errors.empty());
        EXPECT_NE(b.errors[0].find("axis1"), std::string::npos);
        EXPECT_NE(b.errors[0].find("x.toml:"), std::string::npos);
    }
    EXPECT_FALSE(Built(can_sink(0x5A0) + "[[sink]]\nname = \"two\"\nkind = \"can\"\nsource = \"bus\"\ndrive = \"axis1\"\ncan_id = 0x5A1\n").errors.empty());
    EXPECT_FALSE(Built(can_sink(0x5A0), "instant_can_id = 0x5A1\n").errors.empty());
}

TEST(Transmit, RefusesJ1939Commands) {
    for (uint32_t id : {0x0C000003u, 0x0C0400FFu, 0x18EA00FFu, 0x18D3FF00u}) EXPECT_FALSE(Built(can_sink(id, true)).errors.empty()) << std::hex << id;  // TSC1, XBR, request, addressed
    for (uint32_t id : {0x18FF1200u, 0x18EF0012u, 0x1CFFFF00u}) EXPECT_TRUE(Built(can_sink(id, true)).errors.empty()) << std::hex << id;               // proprietary
}

ParameterReport report(double value, double lo, double hi) {
    ParameterReport p;
    p.known = p.trusted = true;
    p.value = value, p.lo = lo, p.hi = hi;
    return p;
}

TEST(CanLayout, HalfWidthIsNeverNarrowerThanItIs) {
    EXPECT_EQ(relative_half_width(report(2.0, 1.9, 2.1)), 501);   // 5 %, rounded up past 0.1 / 2 in binary
    EXPECT_EQ(relative_half_width(report(-4.0, -5.0, -3.0)), 2500);
    EXPECT_EQ(relative_half_width(report(1e-3, -100, 100)), 65535);
    EXPECT_EQ(relative_half_width(report(0, -1, 1)), 65535);
    EXPECT_EQ(relative_half_width(ParameterReport{}), 65535);
}

TEST(CanLayout, NoValueYetIsNoNumberToBeTrusted) {
    const Built b("");
    ASSERT_TRUE(b.errors.empty());
    const canfd_frame f = parameter_frame(*b.drives[0], b.drives[0]->parameters()[0], 0x5A0, false, 0);
    EXPECT_EQ(f.can_id, 0x5A0u);
    EXPECT_EQ(f.len, 8);
    const uint8_t expected[8] = {0, 0, 0, 0, 0xFF, 0xFF, 0, 0xFF};
    EXPECT_EQ(memcmp(f.data, expected, 8), 0);
    EXPECT_EQ(parameter_frame(*b.drives[0], b.drives[0]->parameters()[0], 0x18FF0000, true, 0).can_id, 0x18FF0000u | CAN_EFF_FLAG);
}

std::vector<uint8_t> request(uint8_t unit, uint8_t function, uint16_t address, uint16_t count) {
    return {0, 1, 0, 0, 0, 6, unit, function, uint8_t(address >> 8), uint8_t(address), uint8_t(count >> 8), uint8_t(count)};
}

TEST(ModbusServer, OnlyInputRegistersInRangeReachTheLibrary) {
    const auto check = [](const std::vector<uint8_t>& r) { return check_request(r.data(), r.size(), 1, 100, 16); };
    EXPECT_EQ(check(request(1, 4, 100, 16)), 0);
    EXPECT_EQ(check(request(1, 4, 115, 1)), 0);
    EXPECT_NE(check(request(2, 4, 100, 1)), 0);
    EXPECT_EQ(check(request(1, 4, 99, 1)), 2);
    EXPECT_EQ(check(request(1, 4, 116, 1)), 2);
    EXPECT_EQ(check(request(1, 4, 100, 17)), 2);
    EXPECT_EQ(check(request(1, 4, 65535, 125)), 2);
    EXPECT_EQ(check(request(1, 4, 100, 0)), 3);
    EXPECT_EQ(check(request(1, 4, 100, 126)), 3);
    for (int f = 0; f < 256; ++f)
        EXPECT_EQ(check(request(1, uint8_t(f), 100, 1)), f == 4 ? 0 : 1) << f;
    auto longer = request(1, 4, 100, 1);
    longer.push_back(0);
    EXPECT_EQ(check(longer), 3);
    auto shorter = request(1, 4, 100, 1);
    shorter.resize(10);
    EXPECT_EQ(check(shorter), 3);
}

TEST(ModbusServer, FramesAreCutByTheirOwnLength) {
    size_t length = 0;
    const auto r = request(1, 4, 0, 1);
    for (size_t k = 0; k < r.size(); ++k) EXPECT_EQ(modbus_adu(r.data(), k, length), Adu::incomplete);
    EXPECT_EQ(modbus_adu(r.data(), r.size(), length), Adu::complete);
    EXPECT_EQ(length, 12u);
    auto bad = r;
    bad[2] = 1;
    EXPECT_EQ(modbus_adu(bad.data(), bad.size(), length), Adu::broken);
    bad = r, bad[4] = 0x10;
    EXPECT_EQ(modbus_adu(bad.data(), bad.size(), length), Adu::broken);
    bad = r, bad[5] = 1;
    EXPECT_EQ(modbus_adu(bad.data(), bad.size(), length), Adu::broken);
}

TEST(Maps, NameEveryParameterAndTheRightAddresses) {
    const Built b(can_sink(0x5A0) + "[[sink]]\nname = \"regs\"\nkind = \"modbus_server\"\naddress = 100\n");
    ASSERT_TRUE(b.errors.empty());
    const std::string dbc = signal_map_dbc(b.config, b.drives), table = signal_map_registers(b.config, b.drives);
    for (const auto& p : b.drives[0]->parameters()) {
        EXPECT_NE(dbc.find(p.name), std::string::npos);
        EXPECT_NE(table.find(p.name), std::string::npos);
    }
    EXPECT_NE(table.find("regs,1,104,2,f32,axis1," + std::string(b.drives[0]->parameters()[0].name) + ","), std::string::npos) << table;
    EXPECT_FALSE(Built("[[sink]]\nname = \"regs\"\nkind = \"modbus_server\"\naddress = 65530\n").errors.empty());
}

}  // namespace
