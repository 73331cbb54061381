// SPDX-License-Identifier: Apache-2.0
// The seam under a CAN source: whatever carries frames and stamps. socketcan, a socketpair (tests), an slcan adapter.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include <linux/can.h>

#include <driveid/time.h>

#include "config/config.hpp"

namespace gw {

inline constexpr int kCanBatch = 64;

struct CanBatch {
    int n = 0;
    canfd_frame frame[kCanBatch];
    bool fd[kCanBatch];
    driveid_stamp stamp[kCanBatch];
    uint64_t dropped = 0;        // lost by the kernel since the last batch
    int64_t clock_step_ns = 0;   // of the wall clock
    uint64_t malformed = 0;      // messages that are no frame
};

class CanPort {
public:
    virtual ~CanPort() = default;
    // Readable descriptor, or -1 with a sentence and its mend in error.
    virtual int open(std::string& error) = 0;
    virtual void close() = 0;
    // 0 with batch.n >= 0, or -errno where the port must be opened again.
    virtual int read(CanBatch& batch) = 0;
    // True where the frame was handed over; never blocks.
    virtual bool send(const canfd_frame& frame, bool fd) = 0;
    virtual std::string address() const = 0;
    virtual const char* clock() const = 0;
    virtual void buffer(int64_t& asked, int64_t& granted) const { asked = granted = 0; }
};

// ids: what the kernel need deliver; empty delivers everything.
std::unique_ptr<CanPort> make_socketcan_port(const SourceConfig& config, std::vector<can_filter> filters);
std::unique_ptr<CanPort> make_socketpair_port(const SourceConfig& config);
std::unique_ptr<CanPort> make_slcan_port(const SourceConfig& config);

}  // namespace gw
