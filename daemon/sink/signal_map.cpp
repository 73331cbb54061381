// SPDX-License-Identifier: Apache-2.0
// The published signal maps, and the refusal to send what could move a drive.
#include <cstdio>

#include "drive/field.hpp"
#include "sink/layout.hpp"
#include "sink/make_sink.hpp"
#include "sink/modbus_server.hpp"

namespace gw {

namespace {

std::string hex(uint32_t id) {
    char text[16];
    snprintf(text, sizeof text, "0x%X", id);
    return text;
}

// What an 11-bit identifier means to a CANopen device, nullptr where it commands nothing.
const char* canopen_command(uint32_t id) {
    if (id == 0x000) return "NMT, which starts and stops nodes";
    if (id == 0x080) return "SYNC, at which drives apply set-points";
    if (id == 0x100) return "TIME";
    if (id == 0x7E4 || id == 0x7E5) return "LSS, which renames nodes";
    const uint32_t function = id & 0x780, node = id & 0x7F;
    if (node == 0) return nullptr;
    if (function == 0x200 || function == 0x300 || function == 0x400 || function == 0x500) return "a receive PDO, which carries set-points";
    if (function == 0x600) return "an SDO request, which writes parameters";
    return nullptr;
}

// What a 29-bit identifier means on J1939: addressed groups command a device; only the proprietary one is nobody's.
const char* j1939_command(uint32_t id) {
    const uint32_t format = id >> 16 & 0xFF, page = id >> 24 & 3;
    if (page == 0 && format == 0x00) return "J1939 TSC1, which commands speed and torque";
    if (format < 0xF0 && format != 0xEF) return "a J1939 group addressed to a device";
    return nullptr;
}

size_t frames_of(const SinkConfig& s, const std::vector<std::unique_ptr<Drive>>& drives) {
    for (auto& d : drives)
        if (d->config().name == s.drive) return d->parameters().size();
    return 0;
}

void check_can(const Config& config, const SinkConfig& s, size_t frames, const std::vector<std::unique_ptr<Drive>>& drives, std::vector<std::string>& errors) {
    const auto refuse = [&](uint32_t id, const std::string& why) {
        errors.push_back(config.file + ":" + std::to_string(s.place.line) + ": sink \"" + s.name + "\".can_id: would send " + hex(id) + ", " + why + "; choose another first identifier");
    };
    for (size_t k = 0; k < frames; ++k) {
        const uint32_t id = uint32_t(s.can_id) + uint32_t(k);
        if (id > (s.extended ? 0x1FFFFFFFu : 0x7FFu)) return refuse(id, "which is beyond the last identifier");
        if (const char* what = s.extended ? j1939_command(id) : canopen_command(id)) return refuse(id, std::string("which is ") + what);
        for (const auto& d : config.drives) {
            const auto listens = [&](const FieldConfig& f) { return f.source == s.source && f.address < 0 && CanField(f).matches(id, s.extended); };
            bool collides = d.instant_can_id >= 0 && uint32_t(d.instant_can_id) == id;
            for (const auto& f : d.signals) collides |= listens(f);
            if (d.has_counter) collides |= listens(d.counter);
            if (collides) return refuse(id, "which drive \"" + d.name + "\" listens to");
        }
        for (const auto& other : config.sinks) {
            const bool same_bus = &other != &s && other.kind == "can" && other.source == s.source && other.extended == s.extended;
            if (same_bus && int64_t(id) >= other.can_id && int64_t(id) < other.can_id + int64_t(frames_of(other, drives))) return refuse(id, "which sink \"" + other.name + "\" sends too");
        }
    }
}

template <class F>
void each_can_sink(const Config& config, const std::vector<std::unique_ptr<Drive>>& drives, F f) {
    for (const auto& s : config.sinks)
        for (auto& d : drives)
            if (s.kind == "can" && d->config().name == s.drive) f(s, *d);
}

std::string identifier(std::string text) {
    for (char& c : text)
        if (!isalnum(uint8_t(c))) c = '_';
    return text.substr(0, 32);
}

std::vector<const Drive*> shown_by(const SinkConfig& s, const std::vector<std::unique_ptr<Drive>>& drives) {
    std::vector<const Drive*> shown;
    for (auto& d : drives)
        if (s.drive.empty() || d->config().name == s.drive) shown.push_back(d.get());
    return shown;
}

}  // namespace

void check_transmit(const Config& config, const std::vector<std::unique_ptr<Drive>>& drives, std::vector<std::string>& errors) {
    for (const auto& s : config.sinks) {
        if (s.kind == "can") check_can(config, s, frames_of(s, drives), drives, errors);
        if (s.kind == "modbus_server" && size_t(s.address) + register_count(shown_by(s, drives)) > 65536)
            errors.push_back(config.file + ":" + std::to_string(s.place.line) + ": sink \"" + s.name + "\".address: its registers end behind 65535; choose a smaller address");
    }
}

std::string signal_map_dbc(const Config& config, const std::vector<std::unique_ptr<Drive>>& drives) {
    std::string messages, types, comments, values;
    each_can_sink(config, drives, [&](const SinkConfig& s, const Drive& d) {
        uint32_t id = uint32_t(s.can_id) | (s.extended ? 0x80000000u : 0);
        for (const auto& p : d.parameters()) {
            const std::string n = std::to_string(id++), name = identifier(d.config().name + "_" + p.name);
            messages += "BO_ " + n + " " + name + ": 8 driveidd\n";
            messages += " SG_ value : 0|32@1- (1,0) [0|0] \"" + std::string(p.unit) + "\" Vector__XXX\n";
            messages += " SG_ half_width : 32|16@1+ (0.0001,0) [0|6.5534] \"of |value|\" Vector__XXX\n";
            messages += " SG_ valid : 48|1@1+ (1,0) [0|1] \"\" Vector__XXX\n";
            messages += " SG_ state : 52|4@1+ (1,0) [0|5] \"\" Vector__XXX\n";
            messages += " SG_ age : 56|8@1+ (0.1,0) [0|25.4] \"s\" Vector__XXX\n\n";
            types += "SIG_VALTYPE_ " + n + " value : 1;\n";
            comments += "CM_ BO_ " + n + " \"" + p.name + " of drive " + d.config().name + "\";\n";
            comments += "CM_ SG_ " + n + " half_width \"half-width of the 95 % interval relative to |value|; 6.5535: larger, or unknown\";\n";
            comments += "CM_ SG_ " + n + " age \"age of the value; 25.4: that or more; 25.5: there has been no value yet\";\n";
            values += "VAL_ " + n + " state 0 \"waiting\" 1 \"identifying\" 2 \"valid\" 3 \"frozen\" 4 \"stale\" 5 \"error\" ;\n";
        }
    });
    return "VERSION \"driveid\"\n\nNS_ :\n\nBS_:\n\nBU_: driveidd\n\n" + messages + comments + values + types;
}

std::string signal_map_registers(const Config& config, const std::vector<std::unique_ptr<Drive>>& drives) {
    std::string out = "sink,unit,address,registers,encoding,drive,name,unit_of_value,meaning\n";
    for (const auto& s : config.sinks) {
        if (s.kind != "modbus_server") continue;
        int at = int(s.address);
        const auto row = [&](int n, const char* encoding, const Drive& d, const std::string& name, const char* unit, const char* meaning) {
            out += s.name + "," + std::to_string(s.unit) + "," + std::to_string(at) + "," + std::to_string(n) + "," + encoding + "," + d.config().name + "," + name + "," + unit + "," + meaning + "\n";
            at += n;
        };
        for (auto* d : shown_by(s, drives)) {
            row(1, "u16", *d, "state", "", "0 waiting; 1 identifying; 2 valid; 3 frozen; 4 stale; 5 error");
            row(1, "u16", *d, "alarm", "", "1: the residual left its level");
            row(1, "u16", *d, "rate", "0.1 Hz", "samples a second");
            row(1, "u16", *d, "parameters", "", "number of parameters that follow");
            for (const auto& p : d->parameters()) {
                const std::string n = p.name;
                row(2, "f32", *d, n, p.unit, "value; high word first");
                row(2, "f32", *d, n + ".half_width", p.unit, "half-width of the 95 % interval");
                row(1, "u16", *d, n + ".valid", "", "1: trustworthy now");
                row(1, "u16", *d, n + ".age", "0.1 s", "age of the value; 65535: no value yet");
            }
        }
    }
    return out;
}

}  // namespace gw
