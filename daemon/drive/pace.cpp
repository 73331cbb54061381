// SPDX-License-Identifier: Apache-2.0
#include "drive/pace.hpp"

#include <algorithm>

namespace gw {

namespace {
constexpr int kSteadyRow = 8;
constexpr int64_t kPpm = 200;
constexpr uint64_t kPeriodsMax = 1000000;
}  // namespace

int64_t Pacer::instant(int64_t arrival_ns, uint64_t periods) {
    const int64_t since = arrival_ns - last_arrival_ns_;
    last_arrival_ns_ = arrival_ns;
    torn_ = false;
    if (!running_ || since > silence_ns_ || since < -silence_ns_) {
        running_ = true;
        steady_ = 0;
        return last_ns_ = arrival_ns;
    }
    const int64_t step_ns = int64_t(std::min<uint64_t>(std::max<uint64_t>(periods, 1), kPeriodsMax)) * period_ns_;
    const int64_t expected = last_ns_ + step_ns + step_ns * kPpm / 1000000;
    const bool regular = 2 * since > step_ns && 2 * since < 3 * step_ns;
    steady_ = !periods && regular && arrival_ns - expected >= period_ns_ / 2 ? steady_ + 1 : 0;
    if (steady_ >= kSteadyRow) {
        steady_ = 0;
        torn_ = true;
        return last_ns_ = arrival_ns;
    }
    torn_ = 2 * (expected - arrival_ns) >= period_ns_;
    // Never back, and never onto the last instant.
    last_ns_ = std::max(std::min(arrival_ns, expected), last_ns_ + period_ns_ / 4);
    return last_ns_;
}

}  // namespace gw
