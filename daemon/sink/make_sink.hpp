// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "base/loop.hpp"
#include "drive/drive.hpp"
#include "record/record_writer.hpp"
#include "sink/sink.hpp"
#include "source/source.hpp"

namespace gw {

std::unique_ptr<Sink> make_sink(const SinkConfig& config, const std::vector<std::unique_ptr<Source>>& sources,
                                const std::vector<std::unique_ptr<Drive>>& drives, Loop& loop);
std::unique_ptr<Sink> make_record_sink(const SinkConfig& config, std::unique_ptr<RecordWriter> writer, Loop& loop);

// The frames of CAN sinks must collide neither with what is listened to nor with what moves drives (CANopen control objects,
// J1939 control). Appends to errors.
void check_transmit(const Config& config, const std::vector<std::unique_ptr<Drive>>& drives, std::vector<std::string>& errors);

// The published signal maps.
std::string signal_map_dbc(const Config& config, const std::vector<std::unique_ptr<Drive>>& drives);
std::string signal_map_registers(const Config& config, const std::vector<std::unique_ptr<Drive>>& drives);

}  // namespace gw
