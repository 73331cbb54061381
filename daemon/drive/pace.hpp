// SPDX-License-Identifier: Apache-2.0
// Sampling instants of a drive that samples at an exact rate, from arrivals that are late by a varying time.
#pragma once
#include <cstdint>

namespace gw {

// An arrival is never early: the instant is the earlier of the arrival and one period (as many as the drive's own counter says) after the last instant. The period may be
// wrong by 200 ppm; late arrivals are followed that slowly upwards, an early one at once downwards. Where arrivals stay late
// by half a period or more in a steady row, samples were lost, and the row is believed (not where a counter tells). A long silence begins anew.
// The first instant after it is as late as its arrival was; the arrivals that then come early tear the time line: such a step is no true step.
class Pacer {
public:
    explicit Pacer(int64_t period_ns = 0, int64_t silence_ns = 0) : period_ns_(period_ns), silence_ns_(silence_ns) {}

    int64_t instant(int64_t arrival_ns, uint64_t periods = 0);  // 0: not known, then one
    bool torn() const { return torn_; }  // the last step was not that of the drive, by half a period or more
    void restart() { running_ = false; }

private:
    int64_t period_ns_, silence_ns_;
    int64_t last_ns_ = 0, last_arrival_ns_ = 0;
    int steady_ = 0;  // arrivals in a row, a period apart, that were all late
    bool running_ = false, torn_ = false;
};

}  // namespace gw
