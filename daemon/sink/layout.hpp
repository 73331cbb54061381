// SPDX-License-Identifier: Apache-2.0
// How a parameter stands in a CAN frame and in Modbus registers; the published maps are written from the same numbers.
#pragma once
#include <cstdint>

#include <linux/can.h>

#include "drive/drive.hpp"

namespace gw {

uint16_t relative_half_width(const ParameterReport& p);
uint8_t age_byte(const Drive& d, const ParameterReport& p, int64_t now_ns);
canfd_frame parameter_frame(const Drive& d, const ParameterReport& p, uint32_t can_id, bool extended, int64_t now_ns);

// Input registers. A drive begins with its head, then each parameter; f32 has its high word first.
inline constexpr int kDriveHead = 4;        // state; alarm; rate in 0.1 Hz (u16); number of parameters
inline constexpr int kParameterSize = 6;    // value f32; half-width f32; bit 0 valid; age 0.1 s (65535: no value yet)

}  // namespace gw
