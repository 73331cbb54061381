// SPDX-License-Identifier: Apache-2.0
// Modbus master: one thread a line (a TCP device, or a serial port with its units), libmodbus without its LINK mode,
// own connection with deadline and back-off. Replies reach the main thread through a bounded queue.
#pragma once
#include <memory>
#include <vector>

#include "base/loop.hpp"
#include "source/source.hpp"

namespace gw {

struct RegisterBlock {
    bool holding;
    uint16_t address, count;
    bool operator==(const RegisterBlock&) const = default;
};

// Reads that cover all registers asked of a source: neighbours no more than merge_gap apart in one request of at most 125.
std::vector<RegisterBlock> plan_reads(const Config& config, const SourceConfig& source);

std::unique_ptr<Source> make_modbus_master(const Config& config, int index, Consumer& consumer, Loop& loop);

}  // namespace gw
