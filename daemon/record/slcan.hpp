// SPDX-License-Identifier: Apache-2.0
// One line of the slcan (LAWICEL) protocol: tIIILDD.., TIIIIIIIILDD.., rIIIL, RIIIIIIIIL, optional 4-digit millisecond stamp.
#pragma once
#include <cstddef>
#include <string_view>

#include <linux/can.h>

namespace gw {

enum class Slcan { frame, other, broken };  // other: an answer of the adapter ("z", "V1013", empty)

Slcan slcan_parse(std::string_view line, canfd_frame& out);
// Writes the line with its carriage return; returns its length (at most 27).
size_t slcan_print(const canfd_frame& frame, char* out);

}  // namespace gw
