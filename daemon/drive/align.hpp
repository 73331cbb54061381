// SPDX-License-Identifier: Apache-2.0
// Values that arrive in different messages become one sample with one stamp.
#pragma once
#include <array>
#include <cstdint>
#include <utility>

#include <driveid/sample.h>

namespace gw {

struct AlignOptions {
    uint32_t waited = 0;          // signal bits that must be new in every sample
    uint32_t others = 0;          // signal bits whose last value is used (temperature)
    int sync = -1;                // driveid_signal that closes a sample, -1: complete set
    int64_t tolerance_ns = 0;     // values of one sample lie within this
};

struct AlignCounters {
    uint64_t samples = 0;
    uint64_t incomplete = 0;      // sets thrown away because a value was missing
    uint64_t duplicates = 0;      // set with the last stamp again
    uint64_t late = 0;            // set earlier than the last sample (reordered)
};

class Aligner {
public:
    Aligner() = default;
    explicit Aligner(const AlignOptions& options) : o_(options) {}

    // Values of one message: mask tells which of value[] are new. True where a sample is complete; it is written to out.
    // The stamp of the sample is the earliest of its values: messages are sent after the sampling instant, the first one soonest after.
    // err_ns covers the spread.
    bool add(uint32_t mask, const double* value, const driveid_stamp& stamp, driveid_sample& out);
    void restart() { fresh_ = 0; have_ = 0; have_last_ = false; }
    const AlignCounters& counters() const { return n_; }
    // True once after the stamps went back for good (a clock was set, a device restarted): a new time line has begun.
    bool new_time_line() { return std::exchange(stepped_, false); }

private:
    void begin(uint32_t mask);
    bool close(driveid_sample& out);

    AlignOptions o_;
    AlignCounters n_;
    uint32_t fresh_ = 0, have_ = 0;  // fresh: of those waited for
    std::array<double, DRIVEID_SIGNAL_COUNT> value_{};
    std::array<driveid_stamp, DRIVEID_SIGNAL_COUNT> stamp_{};
    bool have_last_ = false, stepped_ = false;
    int64_t last_ns_ = 0;
    int late_in_a_row_ = 0;
};

}  // namespace gw
