// SPDX-License-Identifier: Apache-2.0
// How readings travel in CAN frames: a layout of bit fields (DBC numbering), encoder of values, and the three files that
// describe it to others: a DBC, a configuration for driveidd, a candump log.
#pragma once
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "run.hpp"

namespace sim {

struct Field {
    std::string signal, unit;
    int start = 0, length = 16;       // DBC numbering: little endian from the LSB, big endian from the MSB
    bool is_signed = true, big_endian = false;
    double scale = 1, offset = 0;
    double counts_per_turn = 0;       // > 0: an encoder that wraps at 2^length
    std::string hold = "instant";
    double Reading::*value = nullptr; // null for the counter
};

struct FrameLayout {
    std::string name;
    std::uint32_t id = 0;
    bool fd = false;
    int length = 8;
    std::vector<Field> fields;
};

struct Frame {
    std::uint32_t id = 0;
    bool fd = false;
    std::uint8_t length = 0;
    std::uint8_t data[64] = {};
    std::int64_t t_ns = 0;
};

struct LayoutOptions { bool fd = false, big_endian = false; std::uint32_t id = 0x181; };

// Default: id has current, angle, counter; id + 0x100 has voltages and the rest. FD: one frame.
std::vector<FrameLayout> default_layout(const Setup &setup, const LayoutOptions &options);

Frame encode(const FrameLayout &layout, const Reading &reading, std::uint32_t counter);
void set_bits(std::uint8_t *data, int start, int length, bool big_endian, std::uint64_t value);

// One line of a candump log; stamp in seconds of the frame's t_ns.
std::string candump_line(const Frame &frame, const std::string &interface);

std::string dbc_text(const std::vector<FrameLayout> &layout);

struct ConfigOptions {
    std::string source_kind = "socketcan", address = "vcan0";  // address: interface, file, or fd number
    std::string socket = "/tmp/driveid-control.sock", drive = "axis1", model, record_folder;
    std::string structure;
    std::map<std::string, double> given;
    double dt_s = 0.001;
    bool fd = false;
};
std::string config_text(const std::vector<FrameLayout> &layout, const ConfigOptions &options);

// The part of a configuration that every bus shares: control socket, the drive's model.
std::string config_head(const ConfigOptions &options);
std::string config_drive(const ConfigOptions &options);

// Signals that a structure uses, of those that a drive can send.
std::vector<std::string> signals_of(const std::string &structure);

}  // namespace sim
