// SPDX-License-Identifier: Apache-2.0
// The manual page of the configuration and the canonical text, both from the table of keys.
#include <cmath>
#include <cstdio>

#include "config/keys.hpp"

namespace gw {

namespace {

std::string show(double v) {
    if (v == kAny) return "inf";
    if (v == -kAny) return "-inf";
    char text[40];
    snprintf(text, sizeof text, "%.10g", v);
    return text;
}

template <class S>
std::string range_of(const Key<S>& key) {
    if (std::holds_alternative<std::string S::*>(key.member)) {
        if (!*key.choices) return "text";
        std::string words = key.choices;
        for (size_t at; (at = words.find('|')) != std::string::npos;) words.replace(at, 1, at + 1 == words.size() ? "" : ", ");
        return words;
    }
    if (std::holds_alternative<bool S::*>(key.member)) return "true, false";
    if (key.lo == -kAny && key.hi == kAny) return "any";
    return show(key.lo) + " .. " + show(key.hi);
}

template <class S>
void rows(std::string& out, std::span<const Key<S>> keys) {
    for (const auto& k : keys) {
        const bool is_text = std::holds_alternative<std::string S::*>(k.member);
        const std::string fallback = !k.fallback ? "required" : is_text ? "\"" + std::string(k.fallback) + "\"" : k.fallback;
        std::string kinds = *k.only_kind ? std::string(" (") + k.only_kind + ")" : "";
        for (size_t at; (at = kinds.find('|')) != std::string::npos;) kinds.replace(at, 1, ", ");
        out += "| `" + std::string(k.name) + "` | " + k.unit + " | " + range_of(k) + " | " + fallback + " | " + k.help + kinds + " |\n";
    }
}

template <class S>
void table(std::string& out, const std::string& title, const std::string& text, std::span<const Key<S>> keys) {
    out += "\n## " + title + "\n\n" + (text.empty() ? "" : text + "\n\n");
    out += "| key | unit | range | default | meaning |\n|---|---|---|---|---|\n";
    rows(out, keys);
}

constexpr const char* kIntro = R"(# Configuration of driveidd

<!-- written by `driveidd --manual`; edit daemon/config/keys.cpp and daemon/config/manual.cpp -->

One TOML file. `driveidd --check FILE` says what is wrong, with file, line, key and mend. Unknown keys are errors, near misses are suggested.
Paths are relative to the folder of the configuration file. Several sources, drives and sinks may stand in one file.

    format = 1

    [control]
    socket = "/run/driveid/control.sock"

    [record]
    folder = "/var/lib/driveid/records"

    [[source]]
    name = "can0"
    kind = "socketcan"              # socketcan | modbus_tcp | modbus_rtu | slcan | replay | socketpair (tests)
    interface = "vcan0"

    [[source]]
    name = "plc"
    kind = "modbus_tcp"
    host = "127.0.0.1"
    poll_s = 0.005

    [[drive]]
    name = "axis1"
    structure = "rigid_axis"        # or model = "axis1.toml"
    given = { K_t_Nm_A = 0.05 }     # known parameters
    effects = ["coulomb"]           # effects that are identified too
    dt_s = 0.001

      [[drive.signal]]
      name = "i_q_A"
      source = "can0"
      can_id = 0x181
      start_bit = 0
      length = 16
      signed = true
      scale = 0.001

      [[drive.signal]]
      name = "theta_rad"
      source = "can0"
      can_id = 0x181
      start_bit = 16
      length = 32
      counts_per_turn = 65536

    [[sink]]
    name = "can_out"
    kind = "can"
    source = "can0"                 # sends on this bus
    drive = "axis1"
    can_id = 0x5A0                  # first identifier; one frame a parameter

    [[sink]]
    name = "regs"
    kind = "modbus_server"

Vibration and torque ripple. A drive with `method = "frequency"` needs no structure: it looks at its one signal and gives frequency and amplitude of one or two sinusoids in it, beside any bias
(`f1_Hz`, `amplitude1_A`, `f2_Hz`, ...), with interval and validity like every parameter; a second drive on the same messages identifies the axis. A sinusoid is valid while it stands out of the
noise and its phase keeps to its frequency; one that moved elsewhere is a restart, and known again within a few seconds. A speed or a current is the signal to take: an angle that turns on is no sinusoid.

    [[drive]]
    name = "axis1_ripple"
    method = "frequency"
    highest_Hz = 60                 # cogging: pole pairs or slots, times the highest speed in turns a second
    dt_s = 0.001

      [[drive.signal]]
      name = "i_q_A"
      source = "can0"
      can_id = 0x181
      signed = true
      scale = 0.001

Samples. Values of a drive that arrive in different messages become one sample. Without `sync` a sample is closed when every signal (except those with
`wait = false`) has arrived anew within `align_tolerance_s`; a value that comes again before its set is complete begins a new set, and the old one counts as
dropped. With `sync` the arrival of that signal closes the sample. The stamp is the earliest of the sample's messages, the error bound covers their spread.
`instant_can_id` names a frame (CANopen SYNC) whose arrival is the sampling instant instead.

Several messages lost are a gap: the estimator's filters restart, parameters are kept. Frames of a CAN source are counted so that
`frames = used + unused + rejected`; error frames are counted apart (`errors`), and what the kernel lost is `dropped`.

Transmit identifiers of a `can` sink are refused where they collide with an identifier that is listened to, with CANopen control objects (NMT 0x000, SYNC 0x080,
TIME 0x100, RPDO 0x200/0x300/0x400/0x500 + node, SDO 0x600 + node, LSS 0x7E4 and 0x7E5), or with J1939 groups that command a device (every addressed group but
the proprietary one, and TSC1). `driveidd --dbc FILE` writes the DBC of what is sent, `driveidd --registers FILE` the table of Modbus registers.

A frame of a `can` sink (8 bytes, little-endian): bytes 0..3 value, f32 SI; bytes 4..5 half-width of the 95 % interval, u16 in 1e-4 of |value|, rounded up, 65535 where it
is larger or unknown; byte 6 bit 0 valid, bits 4..7 state (0 waiting, 1 identifying, 2 valid, 3 frozen, 4 stale, 5 error); byte 7 age in 0.1 s, 254 where it is 25.4 s or more,
255 where there has been no value yet. Nothing is queued: a frame that the bus does not take is dropped and counted, so nothing stale is sent after an outage.

Input registers of a `modbus_server`: each drive has state, alarm, rate in 0.1 Hz, and number of parameters (4 registers); each parameter has its value and half-width (f32, high
word first), valid, and age in 0.1 s, 65535 where there has been no value yet (6 registers). Reading input registers is the only function that it answers.

`SIGHUP` (or `reload` over the control socket) reads the file anew: a wrong one changes nothing; drives that are the same keep what they have learnt; a record goes on in
`NAME-1.drec`, since its numbers of drives and sources are the old file's. A file without a change closes nothing. One that would close a port below 1024 which the daemon, another user by now,
could not open again is refused. `[control]`, `[security]` and `[system]` are read at start only.
)";

}  // namespace

std::string config_manual() {
    std::string out = kIntro;
    table(out, "Top level", "", top_keys());
    table(out, "[control]", "", control_keys());
    table(out, "[record]", "", record_keys());
    table(out, "[state]", "", state_keys());
    table(out, "[security]", "", security_keys());
    table(out, "[system]", "", system_keys());
    table(out, "[[source]]", "", source_keys());
    table(out, "[[drive]]", "Beside these: `given`, a table of known parameters; `effects`, a list of effects that are identified too; `[[drive.signal]]`; `[drive.counter]`.", drive_keys());
    table(out, "[[drive.signal]]", "", signal_keys());
    table(out, "Fields ([[drive.signal]] and [drive.counter])",
          "Where the number stands. `[drive.counter]` is a counter that the drive puts into its message: it tells loss, repetition and reordering apart, and with `paced` it is the clock of the samples (Modbus: read in one request with the signals). "
          "`mux = { start_bit, length, value }`: the signal is there only where the selector has this value.", field_keys());
    table(out, "mux", "", mux_keys());
    table(out, "[[sink]]", "", sink_keys());
    return out;
}

namespace {

template <class S>
void canonical(std::string& out, std::span<const Key<S>> keys, const S& item) {
    for (const auto& k : keys) {
        out += k.name;
        out += '=';
        std::visit([&](auto member) {
            using T = std::remove_cvref_t<decltype(item.*member)>;
            if constexpr (std::is_same_v<T, std::string>) out += item.*member;
            else if constexpr (std::is_same_v<T, double>) {
                char text[40];
                snprintf(text, sizeof text, "%a", item.*member);
                out += text;
            } else out += std::to_string(item.*member);
        }, k.member);
        out += '\n';
    }
}

}  // namespace

std::string config_text(const SourceConfig& s) {
    std::string out;
    canonical(out, source_keys(), s);
    return out;
}

std::string config_text(const SinkConfig& s) {
    std::string out;
    canonical(out, sink_keys(), s);
    return out;
}

std::string config_text(const DriveConfig& d) {
    std::string out;
    canonical(out, drive_keys(), d);
    char number[40];
    for (const auto& [name, value] : d.given) {
        snprintf(number, sizeof number, "%a", value);
        out += "given " + name + "=" + number + "\n";
    }
    for (const auto& e : d.effects) out += "effect " + e + "\n";
    for (const auto& s : d.signals) {
        canonical(out, signal_keys(), s);
        canonical<FieldConfig>(out, field_keys(), s);
        canonical<FieldConfig>(out, mux_keys(), s);
    }
    if (d.has_counter) {
        canonical(out, field_keys(), d.counter);
        canonical(out, mux_keys(), d.counter);
    }
    return out;
}

}  // namespace gw
