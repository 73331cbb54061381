// SPDX-License-Identifier: Apache-2.0
// What is read as a data frame is written and read again as the same frame.
#include <cstring>

#include "fuzz.hpp"
#include "record/slcan.hpp"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    canfd_frame f, again;
    if (gw::slcan_parse(text_of(data, size), f) != gw::Slcan::frame) return 0;
    HOLDS(f.len <= 8);
    if (f.can_id & CAN_RTR_FLAG) return 0;
    char line[32];
    const size_t n = gw::slcan_print(f, line);
    HOLDS(n <= 27 && line[n - 1] == '\r');
    HOLDS(gw::slcan_parse({line, n - 1}, again) == gw::Slcan::frame && memcmp(&f, &again, sizeof f) == 0);
    return 0;
}
