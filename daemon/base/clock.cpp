// SPDX-License-Identifier: Apache-2.0
#include "base/clock.hpp"

#include <algorithm>

namespace gw {

namespace {
constexpr int64_t kStepNs = 1000000;           // 1 ms: slewing by ntpd (500 ppm) never reaches it between two batches of a live bus
constexpr int64_t kCloseNs = 20000;            // readings of the two clocks that lie so close are as good as they get
constexpr int64_t kLongestWaitNs = 5000000000; // a frame may have waited this long in the socket buffer
}

int64_t RealtimeToMonotonic::measure() {
    // Whoever is interrupted between the readings reads again: the closest pair says most.
    int64_t before = 0, real = 0, after = INT64_MAX;
    for (int attempt = 0; attempt < 3 && after - before > kCloseNs; ++attempt) {
        const int64_t b = monotonic_ns(), r = clock_ns(CLOCK_REALTIME), a = monotonic_ns();
        if (attempt == 0 || a - b < after - before) before = b, real = r, after = a;
    }
    return measure(before, real, after);
}

int64_t RealtimeToMonotonic::measure(int64_t before, int64_t real, int64_t after) {
    const int64_t middle = before + (after - before) / 2;
    const int64_t offset = real - middle;
    const int64_t change = measured_ ? offset - offset_ns_ : 0;
    const int64_t slew = measured_ ? (middle - now_mono_ns_) / 2000 : 0;  // 500 ppm
    const int64_t window = (after - before) / 2 + 1;
    const int64_t limit = kStepNs + slew + window + window_ns_;  // an interrupted reading is no step of the clock
    const bool step = change > limit || change < -limit;
    previous_mono_ns_ = measured_ ? now_mono_ns_ : middle - kLongestWaitNs;
    now_mono_ns_ = middle;
    if (!measured_ || step || window <= std::max(window_ns_, kCloseNs)) {
        window_ns_ = window;
        offset_ns_ = offset;
    } else {
        window_ns_ += slew;  // what the old reading may have become wrong by
    }
    measured_ = true;
    stepped_ = step;
    return step ? change : 0;
}

MonotonicStamp RealtimeToMonotonic::convert(int64_t realtime_ns) const {
    const int64_t t = realtime_ns - offset_ns_;
    const int64_t age = now_mono_ns_ - t;
    if (!stepped_ && age >= -window_ns_ && age <= kLongestWaitNs) return {std::min(t, now_mono_ns_), window_ns_};
    // Received at some instant between the last batch and now: the bound says so.
    const int64_t wait = std::min(now_mono_ns_ - previous_mono_ns_, kLongestWaitNs);
    return {now_mono_ns_, std::max(wait, window_ns_)};
}

MonotonicStamp HardwareToMonotonic::convert(int64_t hw, int64_t sw) {
    const int64_t distance = sw - hw;
    reset_ = primed_ && hw < last_hw_ns_ - 1000000000;
    if (!primed_ || reset_) {
        offset_ns_ = distance;
        primed_ = true;
    } else {
        offset_ns_ = std::min(offset_ns_ + std::max<int64_t>(0, hw - last_hw_ns_) / 10000, distance);
    }
    last_hw_ns_ = hw;
    const int64_t t = hw + offset_ns_;
    return {t, std::min<int64_t>(sw - t, 1000000) + 1000};
}

}  // namespace gw
