// SPDX-License-Identifier: Apache-2.0
#include "fuzz.hpp"
#include "record/candump.hpp"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    gw::CandumpLine line;
    if (!gw::candump_parse(text_of(data, size), line)) return 0;
    HOLDS(line.frame.len <= (line.fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN));
    HOLDS(line.t_ns >= 0 && !line.interface.empty());
    HOLDS((line.frame.can_id & CAN_EFF_FLAG) || (line.frame.can_id & CAN_ERR_FLAG) || (line.frame.can_id & CAN_EFF_MASK) <= CAN_SFF_MASK);
    return 0;
}
