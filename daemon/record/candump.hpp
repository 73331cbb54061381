// SPDX-License-Identifier: Apache-2.0
// One line of a candump log: "(1436509052.249713) vcan0 044#2A366C2BBA", "...##<flags><data>" for FD, "#R" for remote.
#pragma once
#include <cstdint>
#include <string_view>

#include <linux/can.h>

namespace gw {

struct CandumpLine {
    int64_t t_ns;
    std::string_view interface;
    canfd_frame frame;       // can_id with flag bits; flags as in linux/can.h
    bool fd;
};

// False where the line is no frame.
bool candump_parse(std::string_view line, CandumpLine& out);

}  // namespace gw
