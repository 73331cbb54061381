// SPDX-License-Identifier: Apache-2.0
// A drive playing in real time on a bus, with things that change while it runs.
#pragma once
#include <csignal>
#include <functional>
#include <string>
#include <vector>

#include "frames.hpp"

namespace sim {

struct PlayRequest {
    std::uint64_t seed = 1;
    std::string structure = "rigid_axis", bus, program = "mixed";
    double rate_Hz = 1000, duration_s = 0;     // 0: until stopped
    double load_change_at_s = -1, load_factor = 1;
    double friction_change_at_s = -1, friction_factor = 1;
    double effect_at_s = -1, effect_size = 1;
    std::string effect;
    bool known_coulomb = false, average = false, instant = false;
    double noise = 1, inject_d = 0.15;         // sensor noise; d current of a PMSM, share of rated
    double speed = 1;                          // of real time; 0: as fast as possible (logs are always so)
    double loss = 0, jitter_s = 0;             // frames lost, and their arrival's jitter
    LayoutOptions layout;
    std::string truth_file, config_file, dbc_file, csv_file;
    ConfigOptions config;
};

// Where frames or readings go. send() returns false where the peer did not take it.
class Bus {
public:
    virtual ~Bus() = default;
    virtual bool send(const std::vector<Frame> &frames, const Reading &reading, std::uint32_t counter) = 0;
    virtual bool real_time() const { return true; }
};

std::unique_ptr<Bus> open_bus(const PlayRequest &request, const Setup &setup);  // throws std::runtime_error with the mend
std::unique_ptr<Bus> open_modbus(const std::string &host, int port, const Setup &setup);
std::string modbus_config(const Setup &setup, const ConfigOptions &options, const std::string &host, int port);

// Runs until the duration is over or *stop is set. Returns frames sent.
std::uint64_t play(const PlayRequest &request, const volatile std::sig_atomic_t *stop);

}  // namespace sim
