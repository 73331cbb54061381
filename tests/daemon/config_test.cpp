// SPDX-License-Identifier: Apache-2.0
// Each mistake is answered with file, line, key and mend.
#include <fstream>
#include <sstream>

#include <gtest/gtest.h>

#include "config/keys.hpp"
#include "source/modbus_master.hpp"

using namespace gw;

namespace {

const char* const kGood = R"(format = 1
[[source]]
name = "bus"
kind = "socketcan"
interface = "vcan0"
[[source]]
name = "plc"
kind = "modbus_tcp"
[[drive]]
name = "axis1"
structure = "rigid_axis"
given = { K_t_Nm_A = 0.05 }
dt_s = 0.001
  [[drive.signal]]
  name = "i_q_A"
  source = "bus"
  can_id = 0x181
  length = 16
  signed = true
  [[drive.signal]]
  name = "theta_rad"
  source = "bus"
  can_id = 0x181
  start_bit = 16
  length = 32
  counts_per_turn = 65536
  mux = { start_bit = 48, length = 8, value = 3 }
[[sink]]
name = "out"
kind = "can"
source = "bus"
drive = "axis1"
can_id = 0x5A0
)";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
    const size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return text.replace(at, from.size(), to);
}

std::string joined(const ConfigResult& r) {
    std::string all;
    for (const auto& e : r.errors) all += e + "\n";
    return all;
}

TEST(Config, ReadsValuesAndDefaults) {
    const ConfigResult r = config_read_text(kGood, "a/b.toml");
    ASSERT_TRUE(r.errors.empty()) << joined(r);
    const Config& c = r.config;
    EXPECT_EQ(c.folder, "a");
    EXPECT_EQ(config_path(c, "m.toml"), "a/m.toml");
    EXPECT_EQ(config_path(c, "/m.toml"), "/m.toml");
    EXPECT_EQ(c.control.socket, "/run/driveid/control.sock");
    EXPECT_EQ(c.sources[0].buffer_bytes, 4194304);
    EXPECT_EQ(c.sources[1].port, 502);
    EXPECT_DOUBLE_EQ(c.sources[1].timeout_s, 0.3);
    ASSERT_EQ(c.drives[0].signals.size(), 2u);
    EXPECT_EQ(c.drives[0].signals[0].can_id, 0x181);
    EXPECT_TRUE(c.drives[0].signals[0].is_signed);
    EXPECT_EQ(c.drives[0].signals[1].mux_value, 3);
    EXPECT_EQ(c.drives[0].signals[1].mux_length, 8);
    EXPECT_EQ(c.drives[0].signals[0].mux_length, 0);
    ASSERT_EQ(c.drives[0].given.size(), 1u);
    EXPECT_DOUBLE_EQ(c.drives[0].given[0].second, 0.05);
    EXPECT_EQ(c.drives[0].type, "f64");
}

struct Mistake { const char* from; const char* to; int line; const char* says; const char* mend; };

TEST(Config, EachMistakeIsNamedWithLineKeyAndMend) {
    const Mistake mistakes[] = {
        {"interface = \"vcan0\"", "interfase = \"vcan0\"", 5, "interfase", "did you mean \"interface\""},
        {"kind = \"socketcan\"", "kind = \"socketcam\"", 4, "source \"bus\".kind", "did you mean \"socketcan\""},
        {"length = 16", "length = 65", 18, "\"i_q_A\".length", "from 1 to 64 bit"},
        {"length = 16", "length = \"16\"", 18, "length", "must be a whole number"},
        {"length = 16", "length = 16.5", 18, "length", "must be a whole number"},
        {"signed = true", "signed = 1", 19, "signed", "true or false"},
        {"dt_s = 0.001", "dt_s = -1", 13, "drive \"axis1\".dt_s", "from 1e-05 to 60 s"},
        {"dt_s = 0.001", "dt_s = nan", 13, "dt_s", "from 1e-05"},
        {"dt_s = 0.001\n", "", 9, "dt_s", "is missing"},
        {"dt_s = 0.001", "dt_s = 0.001\nmotion_rad_s = 20\nbandwidth_rad_s = 80", 9, "axis1\".motion_rad_s", "remove one"},
        {"name = \"i_q_A\"", "name = \"i_q\"", 14, "i_q", "is no signal"},
        {"name = \"i_q_A\"", "name = \"theta_rad\"", 20, "theta_rad", "stands twice"},
        {"source = \"bus\"", "source = \"buss\"", 14, "source", "there is no source \"buss\""},
        {"can_id = 0x181", "can_id = 0x8181", 14, "can_id", "extended = true"},
        {"can_id = 0x181\n", "", 14, "can_id", "either can_id or pgn"},
        {"start_bit = 16", "start_bit = 40", 20, "start_bit", "byte 9 of a frame of 8"},
        {"format = 1", "format = 2", 1, "format", "from 1 to 1"},
        {"structure = \"rigid_axis\"\n", "", 9, "model", "either a model file or a structure"},
        {"given = { K_t_Nm_A = 0.05 }", "given = { K_t_Nm_A = \"big\" }", 12, "given.K_t_Nm_A", "finite number"},
        {"mux = { start_bit = 48, length = 8, value = 3 }", "mux = { start_bit = 48, len = 8, value = 3 }", 27, "mux.len", "unknown key"},
        {"drive = \"axis1\"", "drive = \"axis2\"", 28, "sink \"out\".drive", "no drive \"axis2\""},
        {"source = \"bus\"\ndrive", "source = \"plc\"\ndrive", 28, "sink \"out\".source", "cannot send"},
        {"name = \"plc\"", "name = \"bus\"", 6, "source.name", "used twice"},
        {"name = \"plc\"", "name = \"p l c\"", 6, "source.name", "letters, digits"},
        {"name = \"plc\"\n", "name = \"plc\"\ninterface = \"x\"\n", 8, "interface", "does not belong to kind \"modbus_tcp\""},
        {"[[source]]\nname = \"plc\"", "[source2]\nname = \"plc\"", 6, "source2", "did you mean \"source\""},
        {"kind = \"modbus_tcp\"\n", "kind = \"socketcan\"\ninterface = \"vcan0\"\n", 6, "source \"plc\".interface", "another source's already"},
        {"kind = \"modbus_tcp\"\n", "kind = \"modbus_tcp\"\nhost = \"localhost\"\n", 6, "source \"plc\".host", "numeric IPv4"},
        {"length = 16\n", "length = 16\n  scale = 0\n", 14, "scale", "is 0"},
        {"counts_per_turn = 65536", "counts_per_turn = 65536\n  gear_ratio = 0.0", 20, "gear_ratio", "is 0"},
        {"mux = { start_bit = 48, length = 8, value = 3 }", "mux = { start_bit = 48, length = 8, value = 300 }", 20, "mux.value", "8 bits"},
        {"[[sink]]\n", "[[sink]]\nname = \"regs\"\nkind = \"modbus_server\"\nhost = \"::1\"\n[[sink]]\n", 28, "sink \"regs\".host", "numeric IPv4"},
        {"format = 1\n", "format = 1\n[control]\nsocket = \"/" "ssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssssss" "\"\n", 2, "control.socket", "107"},
        {"format = 1\n", "format = 1\n[control]\nmode = \"rw\"\n", 2, "control.mode", "octal"},
        {"format = 1\n", "format = 1\n\n[system]\nmetrics = \"0.0.0.0:9\"\n", 3, "system.metrics", "loopback"},
        {"interface = \"vcan0\"", "interface = ", 5, "TOML", "mend"},
        {"interface = \"vcan0\"", "interface = \"a\\u0007b\"", 5, "interface", "control character"},
    };
    for (const auto& m : mistakes) {
        const std::string text = replaced(kGood, m.from, m.to);
        const ConfigResult r = config_read_text(text, "gw.toml");
        ASSERT_FALSE(r.errors.empty()) << m.to;
        bool found = false;
        for (const auto& e : r.errors) {
            const bool line = e.starts_with("gw.toml:" + std::to_string(m.line) + ": ");
            found |= line && e.find(m.says) != std::string::npos && e.find(m.mend) != std::string::npos;
        }
        EXPECT_TRUE(found) << m.from << " -> " << m.to << "\n" << joined(r);
    }
}

TEST(Config, AllMistakesAreToldAtOnce) {
    const std::string text = replaced(replaced(kGood, "interface", "interfase"), "dt_s = 0.001", "dt_s = 0");
    EXPECT_GE(config_read_text(text, "x").errors.size(), 2u);
}

TEST(Config, HostileTextsAreRefusedNotFollowed) {
    for (const std::string& text : {std::string(2 << 20, 'a'), std::string(100000, '['), std::string("a = ") + std::string(5000, '['), std::string("\xff\xfe\x00x", 4),
                                    std::string("[drive]\nname=1"), std::string("drive = 3"), std::string("drive = [1, 2]"), std::string("[[drive]]\nsignal = 4"),
                                    std::string("[[drive]]\n[drive.signal]\nname=1"), std::string("[[source]]\n[[source]]"), std::string("control = 1"), std::string("[.a]"), std::string("[\na]"), std::string("[[.a]]"), std::string("[[[a]]]"), std::string(" [ =1"), std::string("["), std::string("[[")})
        EXPECT_FALSE(config_read_text(text, "x").errors.empty()) << text.substr(0, 60);
}

TEST(Config, EveryKeyStandsInTheManual) {
    const std::string manual = config_manual();
    const auto all = [&](auto keys) {
        for (const auto& k : keys) EXPECT_NE(manual.find("| `" + std::string(k.name) + "` |"), std::string::npos) << k.name;
    };
    all(control_keys()), all(record_keys()), all(state_keys()), all(security_keys()), all(system_keys());
    all(source_keys()), all(drive_keys()), all(field_keys()), all(signal_keys()), all(sink_keys()), all(mux_keys());
}

TEST(Config, DefaultsLieInTheirRange) {
    const auto all = [&](auto keys) {
        for (const auto& k : keys) {
            using S = std::remove_cvref_t<decltype(k)>;
            if (!k.fallback || k.member.index() == 0 || k.member.index() == 3) continue;
            const double v = std::stod(k.fallback);
            EXPECT_TRUE(v >= k.lo && v <= k.hi) << k.name;
            static_assert(sizeof(S) > 0);
        }
    };
    all(control_keys()), all(record_keys()), all(state_keys()), all(system_keys());
    all(source_keys()), all(drive_keys()), all(field_keys()), all(signal_keys()), all(sink_keys());
}

std::string registers(std::initializer_list<std::pair<int, const char*>> wanted, int gap) {
    std::string text = "[[source]]\nname=\"p\"\nkind=\"modbus_tcp\"\nmerge_gap=" + std::to_string(gap) + "\n[[drive]]\nname=\"d\"\nstructure=\"rigid_axis\"\ndt_s=0.01\n";
    static const char* const names[] = {"i_A", "theta_rad", "omega_rad_s", "v_V", "T_degC"};
    int k = 0;
    for (auto& [address, encoding] : wanted) text += "[[drive.signal]]\nname=\"" + std::string(names[k++]) + "\"\nsource=\"p\"\naddress=" + std::to_string(address) + "\nencoding=\"" + encoding + "\"\n";
    return text;
}

TEST(ModbusPlan, MergesNeighboursAndNeverAsksForMoreThan125) {
    const auto plan = [&](const std::string& text) {
        const ConfigResult r = config_read_text(text, "x");
        EXPECT_TRUE(r.errors.empty()) << joined(r);
        return plan_reads(r.config, r.config.sources[0]);
    };
    EXPECT_EQ(plan(registers({{100, "i16"}, {101, "u32"}}, 0)), (std::vector<RegisterBlock>{{false, 100, 3}}));
    EXPECT_EQ(plan(registers({{100, "i16"}, {105, "u32"}}, 3)), (std::vector<RegisterBlock>{{false, 100, 1}, {false, 105, 2}}));
    EXPECT_EQ(plan(registers({{105, "u32"}, {100, "i16"}}, 4)), (std::vector<RegisterBlock>{{false, 100, 7}}));
    EXPECT_EQ(plan(registers({{100, "f64"}, {101, "i16"}}, 0)), (std::vector<RegisterBlock>{{false, 100, 4}}));
    EXPECT_EQ(plan(registers({{0, "i16"}, {100, "i16"}, {124, "i16"}, {125, "i16"}}, 124)), (std::vector<RegisterBlock>{{false, 0, 125}, {false, 125, 1}}));
    EXPECT_FALSE(config_read_text(registers({{65535, "u32"}}, 0), "x").errors.empty());
}

}  // namespace
