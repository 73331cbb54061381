// SPDX-License-Identifier: Apache-2.0
// What the kernel says beside each received frame: when it came, and how many were lost before it.
#pragma once
#include <cstdint>
#include <sys/socket.h>

#include <driveid/time.h>

#include "base/clock.hpp"

namespace gw {

// The controller's own stamp where there is one, else the kernel's, else now.
class CanStamps {
public:
    // Once a batch, after it was received. Returns the step of the wall clock, else 0.
    int64_t measure() { return realtime_.measure(); }
    // dropped grows by what was lost since the last frame (SO_RXQ_OVFL).
    void read(const msghdr& header, driveid_stamp& stamp, uint64_t& dropped);
    const char* clock() const { return hardware_ ? "hardware" : "kernel"; }
    // The socket is a new one, its counter of losses too.
    void reopened() { overflow_ = 0; }

private:
    RealtimeToMonotonic realtime_;
    HardwareToMonotonic hardware_clock_;
    bool hardware_ = false;
    uint32_t overflow_ = 0;
};

}  // namespace gw
