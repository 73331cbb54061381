// SPDX-License-Identifier: Apache-2.0
#include "drive/align.hpp"

#include <algorithm>
#include <bit>

namespace gw {

namespace {
constexpr int kLateForGood = 20;  // reordering on a bus never reaches back this often in a row

template <class F>
void each_bit(uint32_t mask, F f) {
    for (; mask; mask &= mask - 1) f(std::countr_zero(mask));
}
}  // namespace

void Aligner::begin(uint32_t mask) {
    // A value that comes again before its set is complete, or too late for it, starts a new set.
    if (!(fresh_ & mask)) return;
    ++n_.incomplete;
    fresh_ = 0;
}

bool Aligner::add(uint32_t mask, const double* value, const driveid_stamp& stamp, driveid_sample& out) {
    mask &= o_.waited | o_.others;
    if (o_.sync < 0) {
        begin(mask);
        int64_t first = stamp.t_ns;
        each_bit(fresh_, [&](int s) { first = std::min(first, stamp_[s].t_ns); });
        if (stamp.t_ns - first > o_.tolerance_ns) {
            ++n_.incomplete;
            fresh_ = 0;
        }
    }
    each_bit(mask, [&](int s) { value_[s] = value[s], stamp_[s] = stamp; });
    fresh_ |= mask & o_.waited;
    have_ |= mask;
    if (o_.sync >= 0) {
        if (!(mask >> o_.sync & 1u)) return false;
        each_bit(fresh_, [&](int s) {
            if (stamp.t_ns - stamp_[s].t_ns > o_.tolerance_ns) fresh_ &= ~(1u << s);
        });
        if (fresh_ != o_.waited) {
            ++n_.incomplete;
            fresh_ = 0;
            return false;
        }
        return close(out);
    }
    return fresh_ == o_.waited && (mask & o_.waited) && close(out);
}

bool Aligner::close(driveid_sample& out) {
    fresh_ = 0;
    int64_t first = INT64_MAX, last = INT64_MIN, err = 0;
    driveid_clock clock = DRIVEID_CLOCK_UNKNOWN;
    each_bit(o_.waited, [&](int s) {
        first = std::min(first, stamp_[s].t_ns);
        last = std::max(last, stamp_[s].t_ns);
        err = std::max(err, stamp_[s].err_ns);
        clock = std::max(clock, stamp_[s].clock);
    });
    if (have_last_ && first <= last_ns_) {
        ++(first == last_ns_ ? n_.duplicates : n_.late);
        if (first == last_ns_ || ++late_in_a_row_ < kLateForGood) return false;
        stepped_ = true;
    }
    late_in_a_row_ = 0;
    have_last_ = true;
    last_ns_ = first;
    ++n_.samples;
    out.stamp = {first, last - first + err, clock};
    out.present = o_.waited | (have_ & o_.others);
    each_bit(out.present, [&](int s) { out.value[s] = value_[s]; });
    return true;
}

}  // namespace gw
