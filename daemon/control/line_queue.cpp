// SPDX-License-Identifier: Apache-2.0
#include "control/line_queue.hpp"

#include <algorithm>

namespace gw {

void LineQueue::put(const void* data, size_t n) {
    const char* p = static_cast<const char*>(data);
    const size_t tail = (head_ + used_) % bytes_.size();
    const size_t first = std::min(n, bytes_.size() - tail);
    memcpy(bytes_.data() + tail, p, first);
    memcpy(bytes_.data(), p + first, n - first);
    used_ += n;
}

uint32_t LineQueue::length_at(size_t position) const {
    uint8_t b[4];
    for (int k = 0; k < 4; ++k) b[k] = uint8_t(bytes_[(position + size_t(k)) % bytes_.size()]);
    uint32_t n;
    memcpy(&n, b, 4);
    return n;
}

// A line that is half sent must be finished: the one behind it goes. Both then stand as before.
void LineQueue::drop_oldest() {
    const uint32_t first = length_at(head_);
    if (partial_ == 0) {
        head_ = (head_ + 4 + first) % bytes_.size();
        used_ -= 4 + first;
    } else {
        const size_t second_at = (head_ + 4 + first) % bytes_.size();
        const uint32_t second = length_at(second_at);
        // Move the first line up against the third one.
        for (size_t k = 0; k < 4 + size_t(first); ++k) {
            const size_t from = (head_ + 4 + first - 1 - k) % bytes_.size();
            bytes_[(from + 4 + second) % bytes_.size()] = bytes_[from];
        }
        head_ = (head_ + 4 + second) % bytes_.size();
        used_ -= 4 + second;
    }
    ++lost_;
}

bool LineQueue::push(std::string_view line) {
    const size_t need = 4 + line.size();
    const uint32_t keep = partial_ && used_ ? 4 + length_at(head_) : 0;
    if (need + keep > bytes_.size()) return ++lost_, false;
    while (bytes_.size() - used_ < need) drop_oldest();
    const uint32_t n = uint32_t(line.size());
    put(&n, 4);
    put(line.data(), line.size());
    return true;
}

std::string_view LineQueue::front() const {
    if (used_ == 0) return {};
    const size_t left = length_at(head_) - partial_;
    const size_t at = (head_ + 4 + partial_) % bytes_.size();
    return {bytes_.data() + at, std::min(left, bytes_.size() - at)};
}

void LineQueue::sent(size_t n) {
    partial_ += n;
    const uint32_t first = length_at(head_);
    if (partial_ < first) return;
    head_ = (head_ + 4 + first) % bytes_.size();
    used_ -= 4 + first;
    partial_ = 0;
}

}  // namespace gw
