// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>

#include "gateway.hpp"

// A property that must hold whatever the input.
#define HOLDS(condition)                                            \
    do {                                                            \
        if (!(condition)) {                                         \
            fprintf(stderr, "does not hold: %s\n", #condition);     \
            abort();                                                \
        }                                                           \
    } while (0)

inline std::string_view text_of(const uint8_t* data, size_t size) { return {reinterpret_cast<const char*>(data), size}; }

struct Nobody final : gw::DriveListener {
    void on_sample(int, const driveid_sample&) override {}
    void on_report(int) override {}
};

inline const char* const kFuzzConfig = R"(
[control]
socket = ""
[[source]]
name = "bus"
kind = "replay"
file = "/nonexistent.log"
[[source]]
name = "plc"
kind = "replay"
file = "/nonexistent.log"
[[drive]]
name = "axis1"
structure = "rigid_axis"
given = { K_t_Nm_A = 0.05 }
dt_s = 0.001
  [[drive.signal]]
  name = "i_q_A"
  source = "bus"
  can_id = 0x181
  signed = true
  scale = 0.001
  [[drive.signal]]
  name = "theta_rad"
  source = "bus"
  can_id = 0x181
  start_bit = 23
  length = 32
  byte_order = "big"
  counts_per_turn = 65536
  mux = { start_bit = 7, length = 2, value = 1 }
  [drive.counter]
  source = "bus"
  can_id = 0x181
  start_bit = 56
  length = 8
[[drive]]
name = "axis2"
structure = "rigid_axis"
given = { K_t_Nm_A = 0.05 }
dt_s = 0.001
  [[drive.signal]]
  name = "i_A"
  source = "plc"
  address = 10
  encoding = "f32"
  [[drive.signal]]
  name = "theta_rad"
  source = "plc"
  address = 100
  encoding = "i32"
  counts_per_turn = 4096
)";
