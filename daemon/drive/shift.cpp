// SPDX-License-Identifier: Apache-2.0
#include "drive/shift.hpp"

#include <algorithm>

namespace gw {

void Shifter::push(const driveid_sample& in) {
    if (end_ > first_) {
        const int64_t since = in.stamp.t_ns - at(end_ - 1).stamp.t_ns;
        if (since <= 0 || since > silence_ns_) restart();
    }
    at(end_++) = in;
    if (end_ - first_ > kRing) ++first_;
    if (pending_ < first_) ++pending_, ++lost_;
}

bool Shifter::next(driveid_sample& out) {
    while (pending_ < end_) {
        const int64_t want = at(pending_).stamp.t_ns + skew_ns_;
        if (want > at(end_ - 1).stamp.t_ns) return false;
        const driveid_sample& here = at(pending_++);
        if (want < at(first_).stamp.t_ns) continue;  // its reading is from before the first one
        uint64_t k = first_;
        while (k + 2 < end_ && at(k + 1).stamp.t_ns < want) ++k;
        const driveid_sample &a = at(k), &b = at(k + 1);
        const double part = double(want - a.stamp.t_ns) / double(b.stamp.t_ns - a.stamp.t_ns);
        out = here;
        for (int s = 0; s < DRIVEID_SIGNAL_COUNT; ++s)
            if (moved_ >> s & 1u) out.value[s] = a.value[s] + part * (b.value[s] - a.value[s]);
        return true;
    }
    return false;
}

}  // namespace gw
