// SPDX-License-Identifier: Apache-2.0
// A CSV record turned into the CAN frames that would have carried it.
#pragma once
#include <string>
#include <vector>

#include "frames.hpp"

namespace sim {

struct CsvFramesRequest {
    std::string csv, log, dbc, config, interface = "vcan0";
    std::vector<std::string> map;      // NAME=COLUMN, or NAME=COLUMN:FACTOR
    bool fd = false, big_endian = false;
    std::uint32_t id = 0x181;
    ConfigOptions options;             // structure, given, model, socket
    bool replay = true;                // configuration reads the log; else the interface
};

// Returns the number of samples. Throws std::runtime_error with line, column and mend.
std::size_t csv_to_frames(const CsvFramesRequest &request);

}  // namespace sim
