// SPDX-License-Identifier: Apache-2.0
// A sink hands parameters on. It reads drives and never changes them.
#pragma once
#include <cstdint>
#include <string>

#include "config/config.hpp"

namespace gw {

struct SinkStatus {
    std::string state = "closed", last_error;
    uint64_t sent = 0, dropped = 0;
};

class Sink {
public:
    explicit Sink(const SinkConfig& config) : config_(config) { status_.last_error.reserve(256); }
    virtual ~Sink() = default;
    virtual void start() = 0;
    virtual std::string address() const = 0;
    const SinkConfig& config() const { return config_; }
    const SinkStatus& status() const { return status_; }

protected:
    SinkConfig config_;
    SinkStatus status_;
};

}  // namespace gw
