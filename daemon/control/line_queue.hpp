// SPDX-License-Identifier: Apache-2.0
// Bounded queue of whole lines to one peer. Where it is full the oldest lines go, and the reader is told how many.
#pragma once
#include <cstdint>
#include <cstring>
#include <string_view>
#include <vector>

namespace gw {

class LineQueue {
public:
    explicit LineQueue(size_t capacity) : bytes_(capacity) {}

    // Events may push out older events; an answer is kept as well as an event is. False where the line is longer than the queue.
    bool push(std::string_view line);
    // Contiguous bytes to send next; empty where there is nothing.
    std::string_view front() const;
    void sent(size_t n);
    bool empty() const { return used_ == 0; }
    uint64_t take_lost() { const uint64_t n = lost_; lost_ = 0; return n; }
    uint64_t lost() const { return lost_; }
    bool fits(size_t n) const { return n + 4 <= bytes_.size() - used_; }

private:
    void put(const void* data, size_t n);
    uint32_t length_at(size_t position) const;
    void drop_oldest();

    std::vector<char> bytes_;
    size_t head_ = 0, used_ = 0;   // ring of [u32 length][bytes]
    size_t partial_ = 0;           // bytes of the first line already sent
    uint64_t lost_ = 0;
};

}  // namespace gw
