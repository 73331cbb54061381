// SPDX-License-Identifier: Apache-2.0
// Writes a .drec on a thread of its own: the sample path copies into a bounded ring and never waits for the disk.
#pragma once
#include <atomic>
#include <string>
#include <thread>

#include "base/loop.hpp"
#include "base/spsc.hpp"
#include "record/drec.hpp"

namespace gw {

class RecordWriter {
public:
    // max_bytes: the file is closed when it reaches this size.
    RecordWriter(std::string path, const std::string& header_json, size_t buffer_bytes, uint64_t max_bytes);
    ~RecordWriter();  // flushes
    RecordWriter(const RecordWriter&) = delete;

    // False where the entry was dropped (ring full, or the file is at its end); dropped() counts it.
    bool write(const EntryHeader& header, const void* payload);
    void finish();  // everything written so far reaches the disk; nothing may be written afterwards
    bool crowded() const { return ring_.used() > ring_.capacity() / 2; }

    const std::string& path() const { return path_; }
    uint64_t entries() const { return entries_; }
    uint64_t dropped() const { return dropped_; }
    uint64_t bytes() const { return bytes_.load(); }
    int error() const { return error_.load(); }    // errno of the last failed write, 0 where all is well
    bool full() const { return full_.load(); }

private:
    void work();
    void wake();
    void drain();
    bool open();
    bool put(const char* data, size_t size);

    std::string path_, header_;
    uint64_t max_bytes_;
    ByteRing ring_;
    uint64_t entries_ = 0, dropped_ = 0;
    std::atomic<uint64_t> bytes_{0};
    std::atomic<int> error_{0};
    std::atomic<bool> full_{false}, stop_{false}, woken_{false};
    Fd file_, wake_;
    std::thread thread_;
};

}  // namespace gw
