// SPDX-License-Identifier: Apache-2.0
// Time: everything downstream is int64 monotonic nanoseconds. Wall clock enters here and goes no further.
#pragma once
#include <cstdint>
#include <ctime>

namespace gw {

inline int64_t to_ns(const timespec& t) { return int64_t(t.tv_sec) * 1000000000 + t.tv_nsec; }

inline int64_t clock_ns(clockid_t id) {
    timespec t;
    clock_gettime(id, &t);
    return to_ns(t);
}

inline int64_t monotonic_ns() { return clock_ns(CLOCK_MONOTONIC); }

struct MonotonicStamp {
    int64_t t_ns;
    int64_t err_ns;
};

// Kernel receive stamps are CLOCK_REALTIME. measure() reads both clocks once per batch; convert() then maps a stamp by its age.
// A step of the wall clock between reception and reading shows as an age that cannot be: negative, or longer than the batch
// could have waited. Such a stamp is replaced by "now" with the error bound that follows.
class RealtimeToMonotonic {
public:
    // Returns the step of the wall clock against the monotonic one since the last call where it exceeds 1 ms, else 0.
    int64_t measure();
    // For tests: the same with readings given.
    int64_t measure(int64_t mono_before_ns, int64_t real_ns, int64_t mono_after_ns);
    MonotonicStamp convert(int64_t realtime_ns) const;
    int64_t now_ns() const { return now_mono_ns_; }

private:
    int64_t now_mono_ns_ = 0, previous_mono_ns_ = 0, offset_ns_ = 0, window_ns_ = 0;
    bool stepped_ = false;
    bool measured_ = false;
};

// A controller's own clock counts from an epoch of its own and drifts. The smallest (software - hardware) distance seen lately
// is the one with the least software latency; it leaks upwards by 100 ppm of elapsed time so that drift is followed.
class HardwareToMonotonic {
public:
    MonotonicStamp convert(int64_t hardware_ns, int64_t software_mono_ns);
    bool reset_seen() const { return reset_; }

private:
    int64_t offset_ns_ = 0, last_hw_ns_ = 0;
    bool primed_ = false, reset_ = false;
};

}  // namespace gw
