// SPDX-License-Identifier: Apache-2.0
// A source brings messages with stamps; the consumer (the gateway) says what became of each.
#pragma once
#include <cstdint>
#include <string>

#include <linux/can.h>

#include <driveid/time.h>

#include "config/config.hpp"

namespace gw {

enum class Fate { used, unused, rejected };

struct ModbusReply {
    uint8_t unit, function;
    uint16_t address, count;
    uint16_t registers[125];
};

class Consumer {
public:
    virtual Fate on_frame(int source, const canfd_frame& frame, bool fd, const driveid_stamp& stamp) = 0;
    virtual Fate on_reply(int source, const ModbusReply& reply, const driveid_stamp& stamp) = 0;
    virtual void on_gap(int source, uint64_t lost) = 0;      // messages are known to be missing from here on
    virtual void on_end(int source) = 0;                     // a replay is over
    virtual bool busy() = 0;                                 // a replay as fast as possible waits while a record is crowded
protected:
    ~Consumer() = default;
};

struct SourceStatus {
    std::string state = "closed", clock = "unknown", bus_state = "", last_error;
    uint64_t frames = 0, used = 0, unused = 0, rejected = 0;  // frames = used + unused + rejected, always
    uint64_t dropped = 0, errors = 0, reopened = 0;
    int64_t buffer_asked = 0, buffer_granted = 0;
    double rate_Hz = 0;
};

class Source {
public:
    Source(const SourceConfig& config, int index, Consumer& consumer) : config_(config), index_(index), consumer_(consumer) {
        status_.last_error.reserve(256);
        status_.state.reserve(32), status_.bus_state.reserve(32), status_.clock.reserve(32);
    }
    virtual ~Source() = default;
    virtual void start() = 0;
    virtual bool can_send() const { return false; }
    virtual bool send(const canfd_frame&, bool /*fd*/) { return false; }   // false: dropped, never queued
    virtual std::string address() const = 0;
    virtual bool waiting() const { return false; }                         // messages have arrived that nobody has read yet

    void tick(double elapsed_s) {
        status_.rate_Hz = double(status_.frames - last_frames_) / elapsed_s;
        last_frames_ = status_.frames;
    }
    const SourceConfig& config() const { return config_; }
    const SourceStatus& status() const { return status_; }
    int index() const { return index_; }

protected:
    void count(Fate fate) {
        ++status_.frames;
        ++(fate == Fate::used ? status_.used : fate == Fate::unused ? status_.unused : status_.rejected);
    }

    SourceConfig config_;
    int index_;
    Consumer& consumer_;
    SourceStatus status_;

private:
    uint64_t last_frames_ = 0;
};

}  // namespace gw
