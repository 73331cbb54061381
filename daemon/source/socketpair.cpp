// SPDX-License-Identifier: Apache-2.0
// Frames over an inherited datagram socket: {struct can_frame | struct canfd_frame, int64 stamp}. The stamp is monotonic
// nanoseconds, 0 where the daemon shall stamp. What the daemon sends has stamp 0.
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/clock.hpp"
#include "source/can_port.hpp"

namespace gw {

namespace {

class Socketpair final : public CanPort {
public:
    explicit Socketpair(const SourceConfig& config) : config_(config) {}

    int open(std::string& error) override {
        int type = 0;
        socklen_t size = sizeof type;
        const int fd = int(config_.descriptor);
        if (getsockopt(fd, SOL_SOCKET, SO_TYPE, &type, &size) < 0 || (type != SOCK_DGRAM && type != SOCK_SEQPACKET)) {
            error = "descriptor " + std::to_string(fd) + " is no inherited datagram socket; start driveidd with one";
            return -1;
        }
        const int half = int(config_.buffer_bytes / 2);
        setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &half, sizeof half);
        fcntl(fd, F_SETFL, fcntl(fd, F_GETFL) | O_NONBLOCK);
        fcntl(fd, F_SETFD, FD_CLOEXEC);
        fd_ = fd;
        return fd;
    }
    void close() override { fd_ = -1; }  // inherited: it stays open for the next configuration

    int read(CanBatch& b) override {
        b.n = 0, b.dropped = 0, b.malformed = 0, b.clock_step_ns = 0;
        while (b.n < kCanBatch) {
            char message[CANFD_MTU + 8 + 1];
            const ssize_t size = recv(fd_, message, sizeof message, MSG_DONTWAIT);
            if (size < 0) return errno == EAGAIN || errno == EINTR ? 0 : -errno;
            if (size == 0 && peer_gone()) return b.n > 0 ? 0 : -ENOTCONN;
            take(b, message, size_t(size));
        }
        return 0;
    }

    bool send(const canfd_frame& frame, bool fd) override {
        char message[CANFD_MTU + 8] = {};
        const size_t size = fd ? CANFD_MTU : CAN_MTU;
        memcpy(message, &frame, size);
        return fd_ >= 0 && ::send(fd_, message, size + 8, MSG_DONTWAIT | MSG_NOSIGNAL) == ssize_t(size + 8);
    }
    std::string address() const override { return "descriptor " + std::to_string(config_.descriptor); }
    const char* clock() const override { return clock_; }
    void buffer(int64_t& asked, int64_t& granted) const override {
        asked = config_.buffer_bytes;
        int value = 0;
        socklen_t size = sizeof value;
        getsockopt(int(config_.descriptor), SOL_SOCKET, SO_RCVBUF, &value, &size);
        granted = value;
    }

private:
    bool peer_gone() const {
        char byte;
        return recv(fd_, &byte, 1, MSG_DONTWAIT | MSG_PEEK) == 0;  // SEQPACKET: an end stays an end
    }
    void take(CanBatch& b, const char* message, size_t size) {
        if (size != CAN_MTU + 8 && size != CANFD_MTU + 8) {
            ++b.malformed;
            return;
        }
        const bool fd = size == CANFD_MTU + 8;
        memset(&b.frame[b.n], 0, sizeof b.frame[b.n]);
        memcpy(&b.frame[b.n], message, size - 8);
        int64_t stamp;
        memcpy(&stamp, message + size - 8, 8);
        b.fd[b.n] = fd;
        b.stamp[b.n] = stamp ? driveid_stamp{stamp, 1000, DRIVEID_CLOCK_KERNEL} : driveid_stamp{monotonic_ns(), 1000000, DRIVEID_CLOCK_DAEMON};
        clock_ = stamp ? "kernel" : "daemon";
        ++b.n;
    }

    SourceConfig config_;
    int fd_ = -1;
    const char* clock_ = "unknown";
};

}  // namespace

std::unique_ptr<CanPort> make_socketpair_port(const SourceConfig& config) { return std::make_unique<Socketpair>(config); }

}  // namespace gw
