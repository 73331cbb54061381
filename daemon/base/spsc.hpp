// SPDX-License-Identifier: Apache-2.0
// Bounded single-producer single-consumer queue; no allocation after construction.
#pragma once
#include <atomic>
#include <cstddef>
#include <vector>

namespace gw {

template <class T>
class Spsc {
public:
    explicit Spsc(size_t capacity) : ring_(capacity + 1) {}

    bool push(const T& item) {
        const size_t tail = tail_.load(std::memory_order_relaxed);
        const size_t next = tail + 1 == ring_.size() ? 0 : tail + 1;
        if (next == head_.load(std::memory_order_acquire)) return false;
        ring_[tail] = item;
        tail_.store(next, std::memory_order_release);
        return true;
    }

    bool pop(T& item) {
        const size_t head = head_.load(std::memory_order_relaxed);
        if (head == tail_.load(std::memory_order_acquire)) return false;
        item = ring_[head];
        head_.store(head + 1 == ring_.size() ? 0 : head + 1, std::memory_order_release);
        return true;
    }

    bool empty() const { return head_.load(std::memory_order_acquire) == tail_.load(std::memory_order_acquire); }

private:
    std::vector<T> ring_;
    std::atomic<size_t> head_{0}, tail_{0};
};

// The same for variable-length byte blocks (each block whole or not at all).
class ByteRing {
public:
    explicit ByteRing(size_t capacity) : ring_(capacity + 1) {}

    size_t used() const {
        const size_t head = head_.load(std::memory_order_acquire), tail = tail_.load(std::memory_order_acquire);
        return tail >= head ? tail - head : ring_.size() - head + tail;
    }
    size_t capacity() const { return ring_.size() - 1; }

    // Both parts are stored together or not at all.
    bool push(const void* a, size_t na, const void* b, size_t nb) {
        if (capacity() - used() < na + nb) return false;
        size_t tail = tail_.load(std::memory_order_relaxed);
        copy_in(static_cast<const char*>(a), na, tail);
        copy_in(static_cast<const char*>(b), nb, tail);
        tail_.store(tail, std::memory_order_release);
        return true;
    }

    // Contiguous bytes at the head, at most the part up to the ring's end.
    const char* peek(size_t& size) const {
        const size_t head = head_.load(std::memory_order_relaxed), tail = tail_.load(std::memory_order_acquire);
        size = tail >= head ? tail - head : ring_.size() - head;
        return ring_.data() + head;
    }
    void consume(size_t size) {
        head_.store((head_.load(std::memory_order_relaxed) + size) % ring_.size(), std::memory_order_release);
    }

private:
    void copy_in(const char* p, size_t n, size_t& tail) {
        for (size_t i = 0; i < n; ++i) {
            ring_[tail] = p[i];
            tail = tail + 1 == ring_.size() ? 0 : tail + 1;
        }
    }
    std::vector<char> ring_;
    std::atomic<size_t> head_{0}, tail_{0};
};

}  // namespace gw
