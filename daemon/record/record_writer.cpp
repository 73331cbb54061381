// SPDX-License-Identifier: Apache-2.0
#include "record/record_writer.hpp"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

namespace gw {

namespace {
constexpr int kRestMs = 50;        // the ring is emptied at least this often
constexpr int kRetryMs = 1000;     // after a failed write
}  // namespace

RecordWriter::RecordWriter(std::string path, const std::string& header_json, size_t buffer_bytes, uint64_t max_bytes)
    : path_(std::move(path)), header_(drec_file_header(header_json)), max_bytes_(max_bytes), ring_(buffer_bytes), wake_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
    if (!open()) error_ = errno;
    thread_ = std::thread([this] { work(); });
}

RecordWriter::~RecordWriter() { finish(); }

void RecordWriter::finish() {
    if (!thread_.joinable()) return;
    stop_ = true;
    wake();
    thread_.join();
}

bool RecordWriter::write(const EntryHeader& header, const void* payload) {
    uint8_t head[kDrecEntryHeader];
    if (full_.load(std::memory_order_relaxed) || header.payload_len > kDrecPayloadMax) return ++dropped_, false;
    drec_encode(header, payload, head);
    if (!ring_.push(head, sizeof head, payload, header.payload_len)) return ++dropped_, false;
    ++entries_;
    // A burst must not wait for the thread's rest; a disk that fails is left to its retry.
    if (crowded() && !error_.load(std::memory_order_relaxed) && !woken_.exchange(true)) wake();
    return true;
}

void RecordWriter::wake() {
    const uint64_t one = 1;
    if (::write(wake_.get(), &one, sizeof one) < 0) { /* the thread wakes by itself within kRestMs */ }
}

bool RecordWriter::open() {
    file_.reset(::open(path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0640));
    bytes_ = 0;
    return file_ && put(header_.data(), header_.size());
}

// All of data or nothing: what a full disk leaves of a torn write is cut off again.
bool RecordWriter::put(const char* data, size_t size) {
    const off_t start = off_t(bytes_.load());
    size_t done = 0;
    while (done < size) {
        const ssize_t n = pwrite(file_.get(), data + done, size - done, start + off_t(done));
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) {
            const int why = n < 0 ? errno : EIO;
            if (done > 0 && ftruncate(file_.get(), start) < 0) { /* readers skip a torn tail */ }
            errno = why;
            return false;
        }
        done += size_t(n);
    }
    bytes_ += size;
    return true;
}

void RecordWriter::drain() {
    size_t size;
    for (const char* data = ring_.peek(size); size > 0; data = ring_.peek(size)) {
        if (bytes_ + size > max_bytes_) full_ = true;
        if (full_) {
            ring_.consume(size);
            continue;
        }
        if (!file_ && !open()) break;
        if (!put(data, size)) break;
        error_ = 0;
        ring_.consume(size);
        continue;
    }
    if (size > 0) error_ = errno;
}

void RecordWriter::work() {
    while (!stop_) {
        pollfd p{wake_.get(), POLLIN, 0};
        poll(&p, 1, error_ ? kRetryMs : kRestMs);
        uint64_t count;
        if (::read(wake_.get(), &count, sizeof count) < 0) { /* nobody woke it */ }
        woken_ = false;
        drain();
    }
    drain();
    if (file_) fdatasync(file_.get());
}

}  // namespace gw
