// SPDX-License-Identifier: Apache-2.0
// Requests of a peer of the Modbus server, and replies that reach a drive.
#include <cmath>
#include <cstring>

#include "fuzz.hpp"
#include "sink/modbus_server.hpp"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    size_t length = 0;
    if (gw::modbus_adu(data, size, length) == gw::Adu::complete) {
        HOLDS(length <= size && length >= 8 && length <= 260);
        if (gw::check_request(data, length, 1, 100, 16) == 0) {
            const int address = data[8] << 8 | data[9], count = data[10] << 8 | data[11];
            HOLDS(length == 12 && data[6] == 1 && data[7] == 4 && count >= 1 && address >= 100 && address + count <= 116);
        }
    }
    static Nobody nobody;
    static const gw::Config config = gw::config_read_text(kFuzzConfig, "x").config;
    gw::Drive drive(config.drives[1], config, 1, nobody);
    int64_t t = 1000000000;
    for (size_t at = 0; at + 8 <= size; at += 8) {
        gw::ModbusReply r{};
        r.unit = data[at] & 3, r.function = uint8_t(3 + (data[at] >> 2 & 1));
        r.address = uint16_t(data[at + 1]), r.count = uint16_t(data[at + 2] % 126);
        for (int k = 0; k < r.count; ++k) r.registers[k] = uint16_t(data[at + 3 + size_t(k) % 4] << 8 | data[at + 4 + size_t(k) % 4]);
        t += int64_t(data[at + 7]) * 10000;
        drive.reply(1, r, {t, 100, DRIVEID_CLOCK_DAEMON});
    }
    for (const auto& p : drive.parameters()) HOLDS(!p.known || (std::isfinite(p.value) && p.lo <= p.hi));
    return 0;
}
