// SPDX-License-Identifier: Apache-2.0
// The JSON objects of docs/manual/control-protocol.md; the record's events and estimates are the same objects.
#pragma once
#include "base/json_out.hpp"
#include "base/log.hpp"
#include "drive/drive.hpp"
#include "sink/sink.hpp"
#include "source/source.hpp"

namespace gw {

class Gateway;

void describe_drive(JsonOut& out, const Drive& drive, int64_t now_ns);
void describe_source(JsonOut& out, const Source& source);
void describe_sink(JsonOut& out, const Sink& sink);
void describe_status(JsonOut& out, const Gateway& gateway, int64_t now_ns);   // fields only, no braces

// Whole events.
void describe_estimate(JsonOut& out, const Drive& drive, int64_t now_ns);
void describe_sample(JsonOut& out, const Drive& drive, const driveid_sample& sample);
void describe_event(JsonOut& out, const LogEvent& event);

}  // namespace gw
