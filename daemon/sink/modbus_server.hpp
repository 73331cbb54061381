// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <memory>
#include <vector>

#include "base/loop.hpp"
#include "drive/drive.hpp"
#include "sink/sink.hpp"

namespace gw {

std::unique_ptr<Sink> make_modbus_server(const SinkConfig& config, std::vector<const Drive*> drives, Loop& loop);

// A request of a peer as far as it has come.
enum class Adu { incomplete, complete, broken };
// Looks at size bytes; where one is complete, length says how long it is.
Adu modbus_adu(const uint8_t* data, size_t size, size_t& length);

// Input registers of the drives as they stand now.
size_t register_count(const std::vector<const Drive*>& drives);
void fill_registers(const std::vector<const Drive*>& drives, int64_t now_ns, std::vector<uint16_t>& out);

// Modbus exception code for a request that must not reach modbus_reply, 0 where it may.
uint8_t check_request(const uint8_t* adu, size_t length, int unit, int first, size_t registers);

}  // namespace gw
