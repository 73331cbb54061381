// SPDX-License-Identifier: Apache-2.0
#include "frames.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace sim {
namespace {

double nice_scale(double largest, int bits) {  // smallest 1, 2 or 5 times a power of ten that holds +-largest
    const double raw = largest / (std::ldexp(1.0, bits - 1) - 1);
    const double ten = std::pow(10.0, std::floor(std::log10(raw)));
    for (double m : {1.0, 2.0, 5.0, 10.0}) if (m * ten >= raw) return m * ten;
    return 10 * ten;
}

std::string text(const char *format, double value) {
    char out[48];
    std::snprintf(out, sizeof out, format, value);
    return out;
}

// Places fields one after another; big-endian fields start at their most significant bit.
void place(FrameLayout &frame, bool big_endian) {
    int bit = 0;
    for (auto &field : frame.fields) {
        field.big_endian = big_endian;
        field.start = big_endian ? (bit / 8) * 8 + 7 - bit % 8 : bit;
        bit += field.length;
    }
}

Field field(const std::string &signal, const std::string &unit, int length, double largest, double Reading::*value, const char *hold = "instant") {
    Field f;
    f.signal = signal; f.unit = unit; f.length = length; f.value = value; f.hold = hold;
    f.scale = nice_scale(largest, length);
    return f;
}

}  // namespace

std::vector<std::string> signals_of(const std::string &structure) {
    if (structure == "linear_axis") return {"F_N", "i_A", "x_m", "v_m_s"};
    if (structure == "dc_circuit" || structure == "dc_drive") return {"v_V", "i_A", "theta_rad", "omega_rad_s"};
    if (structure == "pmsm_drive") return {"v_d_V", "v_q_V", "i_d_A", "i_q_A", "theta_rad"};
    return {"i_q_A", "i_A", "tau_Nm", "theta_rad"};
}

std::vector<FrameLayout> default_layout(const Setup &setup, const LayoutOptions &options) {
    const auto &d = setup.drive;
    const int i_bits = options.fd ? 32 : 16;
    const bool dc = d.structure.rfind("dc_", 0) == 0 || d.linear;
    const char *held = setup.sensors.average ? "average" : "instant";
    Field current = field(dc ? "i_A" : "i_q_A", "A", i_bits, 4 * d.I_rated, &Reading::i, held);
    Field angle;
    angle.signal = d.linear ? "x_m" : "theta_rad"; angle.unit = d.linear ? "m" : "rad"; angle.length = 32; angle.value = &Reading::q;
    if (d.linear) angle.scale = 1 / d.counts;
    else { angle.counts_per_turn = d.counts; angle.scale = 2 * M_PI / d.counts; }
    Field counter;
    counter.signal = "counter"; counter.is_signed = false; counter.length = 16;
    FrameLayout a{"drive_motion", options.id, options.fd, 8, {current, angle, counter}};
    FrameLayout b{"drive_voltage", options.id + 0x100, options.fd, 8, {}};
    if (d.pmsm)
        b.fields = {field("v_d_V", "V", i_bits, 1.2 * d.V_bus, &Reading::v_d, "average"), field("v_q_V", "V", i_bits, 1.2 * d.V_bus, &Reading::v, "average"),
                    field("i_d_A", "A", i_bits, 4 * d.I_rated, &Reading::i_d, held), field("T_degC", "degC", 16, 300, &Reading::T)};
    else
        b.fields = {field("v_V", "V", i_bits, 1.2 * d.V_bus, &Reading::v, "average"), field("T_degC", "degC", 16, 300, &Reading::T),
                    field(d.linear ? "v_m_s" : "omega_rad_s", d.linear ? "m/s" : "rad/s", 32, 3 * d.w_max, &Reading::w)};
    if (!options.fd) {
        place(a, options.big_endian); place(b, options.big_endian);
        return {a, b};
    }
    a.fields.insert(a.fields.end() - 1, b.fields.begin(), b.fields.end());
    a.length = 32;
    place(a, options.big_endian);
    return {a};
}

void set_bits(std::uint8_t *data, int start, int length, bool big_endian, std::uint64_t value) {
    int bit = start;
    for (int n = 0; n < length; ++n) {
        const int source = big_endian ? length - 1 - n : n;
        const auto mask = static_cast<std::uint8_t>(1u << (bit % 8));
        if ((value >> source) & 1) data[bit / 8] |= mask; else data[bit / 8] &= static_cast<std::uint8_t>(~mask);
        bit = !big_endian ? bit + 1 : bit % 8 == 0 ? bit + 15 : bit - 1;
    }
}

Frame encode(const FrameLayout &layout, const Reading &reading, std::uint32_t counter) {
    Frame out;
    out.id = layout.id; out.fd = layout.fd; out.length = static_cast<std::uint8_t>(layout.length);
    for (const auto &f : layout.fields) {
        std::int64_t raw = counter;
        if (f.value) {
            const double steps = std::round((reading.*f.value - f.offset) / f.scale);
            const double top = std::ldexp(1.0, f.length - 1) - 1;
            raw = f.counts_per_turn > 0 ? static_cast<std::int64_t>(steps) : static_cast<std::int64_t>(std::clamp(steps, -top - 1, top));
        }
        set_bits(out.data, f.start, f.length, f.big_endian, static_cast<std::uint64_t>(raw));
    }
    return out;
}

std::string candump_line(const Frame &frame, const std::string &interface) {
    char head[80];
    const auto us = frame.t_ns / 1000;
    std::snprintf(head, sizeof head, "(%lld.%06lld) %s %0*X#%s", static_cast<long long>(us / 1000000), static_cast<long long>(us % 1000000),
                  interface.c_str(), frame.id > 0x7FF ? 8 : 3, frame.id, frame.fd ? "#1" : "");
    std::string out = head;
    char byte[4];
    for (int n = 0; n < frame.length; ++n) { std::snprintf(byte, sizeof byte, "%02X", frame.data[n]); out += byte; }
    return out + "\n";
}

std::string dbc_text(const std::vector<FrameLayout> &layout) {
    std::string out = "VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: drive\n\n";
    for (const auto &frame : layout) {
        out += "BO_ " + std::to_string(frame.id | (frame.id > 0x7FF ? 0x80000000u : 0u)) + " " + frame.name + ": " + std::to_string(frame.length) + " drive\n";
        for (const auto &f : frame.fields)
            out += " SG_ " + f.signal + " : " + std::to_string(f.start) + "|" + std::to_string(f.length) + "@" + (f.big_endian ? "0" : "1") +
                   (f.is_signed ? "-" : "+") + " (" + text("%.17g", f.scale) + "," + text("%.17g", f.offset) + ") [0|0] \"" + f.unit + "\" Vector__XXX\n";
        out += "\n";
    }
    for (const auto &frame : layout)
        if (frame.fd) out += "BA_DEF_ BO_ \"VFrameFormat\" ENUM \"StandardCAN\",\"ExtendedCAN\",\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"reserved\",\"StandardCAN_FD\",\"ExtendedCAN_FD\";\nBA_DEF_DEF_ \"VFrameFormat\" \"StandardCAN\";\nBA_ \"VFrameFormat\" BO_ " +
                              std::to_string(frame.id) + " 14;\n";
    return out;
}

std::string config_head(const ConfigOptions &o) {
    std::string out = "format = 1\n\n[control]\nsocket = \"" + o.socket + "\"\n";
    if (!o.record_folder.empty()) out += "\n[record]\nfolder = \"" + o.record_folder + "\"\n";
    return out;
}

std::string config_drive(const ConfigOptions &o) {
    std::string out = "\n[[drive]]\nname = \"" + o.drive + "\"\n";
    if (!o.model.empty()) {
        out += "model = \"" + o.model + "\"\n";
    } else {
        out += "structure = \"" + o.structure + "\"\n";
        std::string given;
        for (const auto &[name, value] : o.given) given += (given.empty() ? "" : ", ") + name + " = " + text(value == std::floor(value) ? "%.1f" : "%.17g", value);
        if (!given.empty()) out += "given = { " + given + " }\n";
    }
    return out + "method = \"fsm\"\ntype = \"f64\"\ndt_s = " + text("%.9g", o.dt_s) + "\n";
}

std::string config_text(const std::vector<FrameLayout> &layout, const ConfigOptions &o) {
    std::string out = config_head(o) + "\n[[source]]\nname = \"bus\"\nkind = \"" + o.source_kind + "\"\n";
    if (o.source_kind == "socketcan") out += "interface = \"" + o.address + "\"\nfd = " + (o.fd ? "true" : "false") + "\n";
    else if (o.source_kind == "replay") out += "file = \"" + o.address + "\"\nspeed = 1.0\n";
    else out += "descriptor = " + o.address + "\n";
    out += config_drive(o);
    const auto wanted = signals_of(o.structure);
    for (const auto &frame : layout)
        for (const auto &f : frame.fields) {
            if (std::find(wanted.begin(), wanted.end(), f.signal) == wanted.end()) continue;
            char id[16];
            std::snprintf(id, sizeof id, "0x%X", frame.id);
            out += "\n  [[drive.signal]]\n  name = \"" + f.signal + "\"\n  source = \"bus\"\n  can_id = " + id + "\n";
            if (frame.id > 0x7FF) out += "  extended = true\n";
            out += "  start_bit = " + std::to_string(f.start) + "\n  length = " + std::to_string(f.length) + "\n  byte_order = \"" +
                   (f.big_endian ? "big" : "little") + "\"\n  signed = " + (f.is_signed ? "true" : "false") + "\n";
            if (f.counts_per_turn > 0) out += "  counts_per_turn = " + text("%.1f", f.counts_per_turn) + "\n";
            else out += "  scale = " + text("%.17g", f.scale) + "\n";
            out += "  hold = \"" + f.hold + "\"\n";
        }
    return out;
}

}  // namespace sim
