// SPDX-License-Identifier: Apache-2.0
// Frames of any content through decode, align and estimator: every estimate that is shown as known is finite.
#include <cmath>
#include <cstring>

#include "fuzz.hpp"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    static Nobody nobody;
    static const gw::Config config = gw::config_read_text(kFuzzConfig, "x").config;
    gw::Drive drive(config.drives[0], config, 0, nobody);
    int64_t t = 1000000000;
    for (size_t at = 0; at + 12 <= size; at += 12) {
        canfd_frame f{};
        f.can_id = data[at] & 1 ? 0x181u : uint32_t(data[at] | data[at + 1] << 8) << (data[at] % 16);
        f.len = data[at + 1] % 65;
        memcpy(f.data, data + at + 4, 8);
        t += int64_t(int8_t(data[at + 2])) * 20000 + int64_t(data[at + 3]) * 4000;
        drive.frame(0, f, f.can_id & CAN_EFF_FLAG, {t, 1000, DRIVEID_CLOCK_KERNEL});
        if (data[at] == 0xFE) drive.gap(0, data[at + 1]);
    }
    for (const auto& p : drive.parameters()) HOLDS(!p.known || (std::isfinite(p.value) && std::isfinite(p.lo) && p.lo <= p.hi));
    return 0;
}
