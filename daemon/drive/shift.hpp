// SPDX-License-Identifier: Apache-2.0
// Corrects readings that are older (or younger) than their stamps beside those of the motion.
#pragma once
#include <array>
#include <cstdint>

#include <driveid/sample.h>

namespace gw {

// Every sample keeps its stamp and its motion; the moved signals are those of a straight line at stamp + skew. A skew above 0 waits for the reading behind it.
// Across a silence nothing is joined. No allocation.
class Shifter {
public:
    static constexpr int kReach = 8;  // sample times that a skew may be

    Shifter() = default;
    Shifter(int64_t skew_ns, uint32_t moved, int64_t silence_ns) : skew_ns_(skew_ns), silence_ns_(silence_ns), moved_(moved) {}

    // emit(sample) for each sample that is now complete: none, one, or (uneven stamps) several.
    template <class F>
    void add(const driveid_sample& in, F emit) {
        if (skew_ns_ == 0) return emit(in);
        push(in);
        driveid_sample out;
        while (next(out)) emit(out);
    }
    void restart() { first_ = pending_ = end_; }
    int64_t skew_ns() const { return skew_ns_; }
    uint64_t lost() const { return lost_; }  // samples that came too densely to be kept until their reading

private:
    static constexpr uint64_t kRing = 256;

    void push(const driveid_sample& in);
    bool next(driveid_sample& out);
    driveid_sample& at(uint64_t k) { return ring_[k % kRing]; }

    int64_t skew_ns_ = 0, silence_ns_ = 0;
    uint32_t moved_ = 0;
    uint64_t lost_ = 0;
    uint64_t first_ = 0, pending_ = 0, end_ = 0;   // oldest kept, next to be given out, one after the newest
    std::array<driveid_sample, kRing> ring_{};
};

}  // namespace gw
