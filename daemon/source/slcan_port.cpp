// SPDX-License-Identifier: Apache-2.0
// A CAN adapter that speaks slcan on a serial port, without the kernel's driver. Bad lines are skipped and counted.
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <poll.h>
#include <unistd.h>

#include "base/clock.hpp"
#include "record/slcan.hpp"
#include "source/can_port.hpp"
#include "source/serial.hpp"

namespace gw {

namespace {

class SlcanPort final : public CanPort {
public:
    explicit SlcanPort(const SourceConfig& config) : config_(config) {}

    int open(std::string& error) override {
        fd_ = open_serial(config_.device, long(config_.baud), error);
        if (!fd_) return -1;
        static const struct { int64_t rate; char code; } codes[] = {{10000, '0'}, {20000, '1'}, {50000, '2'}, {100000, '3'}, {125000, '4'}, {250000, '5'}, {500000, '6'}, {800000, '7'}, {1000000, '8'}};
        char hello[] = "C\rS6\rO\r";
        for (const auto& c : codes)
            if (c.rate == config_.bitrate) hello[3] = c.code;
        if (write(fd_.get(), hello, 7) != 7) {
            error = config_.device + ": " + strerror(errno) + "; the adapter takes no bytes";
            fd_.reset();
            return -1;
        }
        used_ = 0;
        skipping_ = false;
        return fd_.get();
    }
    void close() override {
        if (fd_ && write(fd_.get(), "C\r", 2) < 0) { /* it is gone already */ }
        fd_.reset();
    }

    int read(CanBatch& b) override {
        b.n = 0, b.dropped = 0, b.malformed = 0, b.clock_step_ns = 0;
        char bytes[1024];
        // At most as many bytes as a full batch of shortest lines ("t0000\r") can hold.
        const ssize_t n = ::read(fd_.get(), bytes, 6 * kCanBatch);
        if (n < 0) return errno == EAGAIN || errno == EINTR ? 0 : -errno;
        if (n == 0) return hung_up() ? -ENODEV : 0;
        const int64_t now = monotonic_ns();
        // Bytes that were read together came one after another: a burst of lines keeps its order in time.
        for (ssize_t k = 0; k < n; ++k) byte(bytes[k], now - wire_ns(size_t(n - 1 - k)), b);
        return 0;
    }

    bool send(const canfd_frame& frame, bool fd) override {
        char line[32];
        if (fd || !fd_) return false;
        const size_t n = slcan_print(frame, line);
        return write(fd_.get(), line, n) == ssize_t(n);
    }
    std::string address() const override { return config_.device; }
    const char* clock() const override { return "daemon"; }

private:
    bool hung_up() const {
        pollfd p{fd_.get(), POLLIN, 0};
        return poll(&p, 1, 0) > 0 && p.revents & (POLLHUP | POLLERR | POLLNVAL);
    }

    int64_t wire_ns(size_t bytes) const { return int64_t(bytes) * 10 * 1000000000 / config_.baud; }

    void byte(char c, int64_t now, CanBatch& b) {
        if (c == '\a') return void(++b.malformed);  // the adapter refuses a command
        if (c != '\r' && c != '\n') {
            if (used_ == sizeof line_) skipping_ = true;
            else line_[used_++] = c;
            return;
        }
        const std::string_view line(line_, used_);
        const bool whole = !skipping_;
        used_ = 0;
        skipping_ = false;
        if (!whole) return void(++b.malformed);
        const Slcan what = slcan_parse(line, b.frame[b.n]);
        if (what == Slcan::broken) ++b.malformed;
        if (what != Slcan::frame) return;
        // The line took its time on the serial port: that is the error bound.
        const int64_t on_wire = wire_ns(line.size() + 1);
        last_ns_ = std::max(now - on_wire, last_ns_ + 1);
        b.fd[b.n] = false;
        b.stamp[b.n] = {last_ns_, on_wire + 1000000, DRIVEID_CLOCK_DAEMON};
        ++b.n;
    }

    SourceConfig config_;
    Fd fd_;
    char line_[64];
    size_t used_ = 0;
    int64_t last_ns_ = 0;
    bool skipping_ = false;
};

}  // namespace

std::unique_ptr<CanPort> make_slcan_port(const SourceConfig& config) { return std::make_unique<SlcanPort>(config); }

}  // namespace gw
