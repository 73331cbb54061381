// SPDX-License-Identifier: Apache-2.0
// What no single key can say: names that must exist, geometry that must fit, ports that must differ.
#include <algorithm>
#include <arpa/inet.h>
#include <cstdlib>
#include <set>

#include <driveid/sample.h>

#include "drive/shift.hpp"
#include "config/config.hpp"
#include "drive/field.hpp"

namespace gw {

namespace {

class Checker {
public:
    explicit Checker(ConfigResult& result) : c_(result.config), errors_(result.errors) {}

    void all() {
        names();
        for (const auto& s : c_.sources) source(s);
        for (const auto& d : c_.drives) drive(d);
        for (const auto& s : c_.sinks) sink(s);
        buses();
        ports();
        sections();
    }

private:
    void error(const Place& at, const std::string& what, const std::string& text) {
        errors_.push_back(c_.file + ":" + std::to_string(at.line) + ": " + what + ": " + text);
    }

    template <class T>
    void unique(const std::vector<T>& items, const char* kind) {
        std::set<std::string> seen;
        for (const auto& i : items) {
            const bool good = !i.name.empty() && i.name.size() <= 40 && i.name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.-") == std::string::npos;
            if (!good) error(i.place, std::string(kind) + ".name", "must be 1 to 40 letters, digits, _ . or -");
            if (!seen.insert(i.name).second) error(i.place, std::string(kind) + ".name", "\"" + i.name + "\" is used twice; rename one");
        }
    }
    void names() {
        unique(c_.sources, "source");
        unique(c_.drives, "drive");
        unique(c_.sinks, "sink");
    }

    const SourceConfig* find_source(const std::string& name) const {
        for (const auto& s : c_.sources)
            if (s.name == name) return &s;
        return nullptr;
    }

    void numeric(const std::string& host, const Place& place, const std::string& what) {
        in_addr address;
        if (inet_pton(AF_INET, host.c_str(), &address) != 1) error(place, what, "\"" + host + "\" is no numeric IPv4 address, such as 192.168.0.10; names are not looked up");
    }

    void source(const SourceConfig& s) {
        const std::string what = "source \"" + s.name + "\"";
        const auto needs = [&](const std::string& value, const char* key) {
            if (value.empty()) error(s.place, what + "." + key, std::string("is missing; add ") + key + " = \"...\"");
        };
        if (s.kind == "socketcan") {
            needs(s.interface, "interface");
            if (s.interface.size() > 15) error(s.place, what + ".interface", "is longer than 15 characters; ip link shows the names");
        }
        if (s.kind == "replay") needs(s.file, "file");
        if (s.kind == "modbus_tcp") numeric(s.host, s.place, what + ".host");
        if (s.kind == "slcan" || s.kind == "modbus_rtu") needs(s.device, "device");
        if (s.kind == "slcan") {
            static const int64_t rates[] = {10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000, 1000000};
            if (std::find(std::begin(rates), std::end(rates), s.bitrate) == std::end(rates))
                error(s.place, what + ".bitrate", "slcan knows 10, 20, 50, 100, 125, 250, 500, 800 and 1000 kbit/s; choose one");
        }
    }

    void field(const FieldConfig& f, const std::string& what) {
        const SourceConfig* s = find_source(f.source);
        if (!s) return error(f.place, what + ".source", "there is no source \"" + f.source + "\"; add it or mend the name");
        if (f.scale == 0) error(f.place, what + ".scale", "is 0: every value would be the offset");
        if (f.gear_ratio == 0) error(f.place, what + ".gear_ratio", "is 0: nothing would turn");
        if (f.min > f.max) error(f.place, what + ".min", "is above max");
        const bool modbus = s->kind == "modbus_tcp" || s->kind == "modbus_rtu" || (s->kind == "replay" && f.address >= 0);
        if (modbus) return modbus_field(f, what);
        if (f.address >= 0) error(f.place, what + ".address", "source \"" + f.source + "\" is a CAN source; use can_id");
        if ((f.can_id >= 0) == (f.pgn >= 0)) return error(f.place, what + ".can_id", "give either can_id or pgn");
        if (f.can_id > 0x7FF && !f.extended) error(f.place, what + ".can_id", "is longer than 11 bits; add extended = true");
        if (!f.encoding.empty() && f.encoding != "f32" && f.encoding != "f64") error(f.place, what + ".encoding", "on CAN only f32 and f64; use length and signed for integers");
        const CanField geometry(f);
        const size_t longest = s->fd || s->kind == "replay" ? 64 : 8;
        if (geometry.bytes() > longest)
            error(f.place, what + ".start_bit", "the field ends in byte " + std::to_string(geometry.bytes()) + " of a frame of " + std::to_string(longest) + "; mend start_bit, length or byte_order");
        if (f.wrap_counts > 0 && f.length < 63 && f.wrap_counts > (int64_t(1) << f.length)) error(f.place, what + ".wrap_counts", "does not fit into length bits");
        if (f.mux_length > 0 && f.mux_value >> f.mux_length) error(f.place, what + ".mux.value", "does not fit into the selector's " + std::to_string(f.mux_length) + " bits");
    }
    void modbus_field(const FieldConfig& f, const std::string& what) {
        if (f.address < 0) return error(f.place, what + ".address", "is missing; add the register address, counted from 0");
        if (f.can_id >= 0 || f.pgn >= 0) error(f.place, what + ".can_id", "does not belong to a Modbus source; remove it");
        const RegisterField geometry(f);
        if (f.registers > 0 && f.registers != geometry.count)
            error(f.place, what + ".registers", "encoding " + (f.encoding.empty() ? "u16" : f.encoding) + " takes " + std::to_string(geometry.count) + "; mend one of them");
        if (f.address + geometry.count > 65536) error(f.place, what + ".address", "ends behind register 65535");
    }

    void structure(const DriveConfig& d, const std::string& what) {
        if (d.model.empty() == d.structure.empty()) error(d.place, what + ".model", "give either a model file or a structure");
        if (d.sinusoids > 0 || d.highest_Hz > 0) error(d.place, what + (d.sinusoids > 0 ? ".sinusoids" : ".highest_Hz"), "belongs to method = \"frequency\"; remove it, or change the method");
    }

    // The method looks at one signal by itself: what a structure would need is of no use.
    void frequency(const DriveConfig& d, const std::string& what) {
        const auto refuse = [&](bool given, const char* key, const char* text) {
            if (given) error(d.place, what + "." + key, text);
        };
        const char* alone = "does not belong to method = \"frequency\", which looks at one signal by itself; remove it, or identify it in a [[drive]] of its own on the same messages";
        refuse(!d.model.empty(), "model", alone);
        refuse(!d.structure.empty(), "structure", alone);
        refuse(!d.given.empty(), "given", alone);
        refuse(!d.effects.empty(), "effects", alone);
        refuse(d.signals.size() > 1, "signal", "method = \"frequency\" takes one; give each signal a [[drive]] of its own");
        refuse(d.bandwidth_rad_s > 0, "bandwidth_rad_s", "method = \"frequency\" has it from highest_Hz; remove it");
        refuse(d.motion_rad_s > 0, "motion_rad_s", "method = \"frequency\" has it from highest_Hz; remove it");
        refuse(d.highest_Hz <= 0, "highest_Hz", "is missing; add the highest frequency that is expected");
        refuse(d.highest_Hz * d.dt_s > 0.2, "highest_Hz", "is above a fifth of the sampling rate 1/dt_s; sample faster, or expect less");
    }

    void drive(const DriveConfig& d) {
        const std::string what = "drive \"" + d.name + "\"";
        if (d.method == "frequency") frequency(d, what);
        else structure(d, what);
        if (d.signals.empty()) error(d.place, what + ".signal", "there is none; add [[drive.signal]]");
        std::set<std::string> seen;
        for (const auto& s : d.signals) {
            const std::string path = what + ".signal \"" + s.name + "\"";
            driveid_signal signal;
            if (driveid_signal_from_name(s.name.c_str(), &signal) != DRIVEID_OK) error(s.place, path + ".name", "is no signal; driveidd --manual lists them");
            if (!seen.insert(s.name).second) error(s.place, path, "stands twice; remove one");
            field(s, path);
        }
        if (d.has_counter) field(d.counter, what + ".counter");
        if (!d.sync.empty() && !seen.count(d.sync)) error(d.place, what + ".sync", "\"" + d.sync + "\" is no signal of this drive");
        if (std::none_of(d.signals.begin(), d.signals.end(), [](auto& s) { return s.wait; }) && !d.signals.empty())
            error(d.place, what, "all signals have wait = false: nothing would close a sample; leave it out for one");
        if (std::abs(d.skew_s) > Shifter::kReach * d.dt_s) error(d.place, what + ".skew_s", "is beyond " + std::to_string(Shifter::kReach) + " dt_s; take whole samples off with the signals' delay_s");
        if (d.motion_rad_s > 0 && d.bandwidth_rad_s > 0) error(d.place, what + ".motion_rad_s", "bandwidth_rad_s is given too; remove one of them");
        if (d.gap_s > 0 && d.gap_s < d.dt_s) error(d.place, what + ".gap_s", "is below dt_s");
    }

    void sink(const SinkConfig& s) {
        const std::string what = "sink \"" + s.name + "\"";
        const bool known = std::any_of(c_.drives.begin(), c_.drives.end(), [&](auto& d) { return d.name == s.drive; });
        if (!s.drive.empty() && !known) error(s.place, what + ".drive", "there is no drive \"" + s.drive + "\"");
        if (s.kind == "record") {
            if (s.file.empty() || s.file.find('/') != std::string::npos || s.file[0] == '.') error(s.place, what + ".file", "must be a bare name below [record] folder, such as \"run.drec\"");
        }
        if (s.kind == "modbus_server") numeric(s.host, s.place, what + ".host");
        if (s.kind != "can") return;
        if (s.drive.empty()) error(s.place, what + ".drive", "is missing; add the drive whose parameters it sends");
        const SourceConfig* source = find_source(s.source);
        if (!source) return error(s.place, what + ".source", "there is no source \"" + s.source + "\"; it sends on the bus of a CAN source");
        if (source->kind != "socketcan" && source->kind != "socketpair" && source->kind != "slcan")
            error(s.place, what + ".source", "\"" + s.source + "\" is a " + source->kind + " source and cannot send");
        if (s.can_id < 0) error(s.place, what + ".can_id", "is missing; add the first identifier");
        if (s.can_id > 0x7FF && !s.extended) error(s.place, what + ".can_id", "is longer than 11 bits; add extended = true");
    }

    // Which identifiers are free is asked of one source: a bus under two names would hide what the other one hears.
    void buses() {
        std::set<std::string> used;
        for (const auto& s : c_.sources) {
            const bool socketcan = s.kind == "socketcan", slcan = s.kind == "slcan", pair = s.kind == "socketpair";
            if (!socketcan && !slcan && !pair) continue;
            const std::string port = socketcan ? s.interface : slcan ? s.device : "descriptor " + std::to_string(s.descriptor);
            if (!port.empty() && !used.insert(s.kind + " " + port).second)
                error(s.place, "source \"" + s.name + "\"." + (socketcan ? "interface" : slcan ? "device" : "descriptor"), port + " is another source's already; name that source in signals and sinks");
        }
    }
    void ports() {
        std::set<std::string> used;
        for (const auto& s : c_.sinks)
            if (s.kind == "modbus_server" && !used.insert(s.host + ":" + std::to_string(s.port)).second)
                error(s.place, "sink \"" + s.name + "\".port", std::to_string(s.port) + " is used twice; choose another");
    }

    void sections() {
        char* end = nullptr;
        const long mode = strtol(c_.control.mode.c_str(), &end, 8);
        if (c_.control.mode.empty() || *end || mode < 0 || mode > 0777) error(c_.control.place, "control.mode", "must be octal permissions such as \"0660\"");
        if (config_path(c_, c_.control.socket).size() > 107) error(c_.control.place, "control.socket", "is longer than the 107 characters that a socket's path may have; choose a shorter one");
        const std::string& f = c_.record.file;
        if (!f.empty() && (f.find('/') != std::string::npos || f[0] == '.')) error(c_.record.place, "record.file", "must be a bare name; the folder is record.folder");
        const std::string& m = c_.system.metrics;
        const size_t colon = m.rfind(':');
        if (!m.empty() && (colon == std::string::npos || atoi(m.c_str() + colon + 1) < 1 || atoi(m.c_str() + colon + 1) > 65535 || !(m.starts_with("127.") || m.starts_with("[::1]"))))
            error(c_.system.place, "system.metrics", "must be a loopback address with port, such as \"127.0.0.1:9464\"");
    }

    const Config& c_;
    std::vector<std::string>& errors_;
};

}  // namespace

void config_check(ConfigResult& result) { Checker(result).all(); }

}  // namespace gw
