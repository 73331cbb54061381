// SPDX-License-Identifier: Apache-2.0
#include <cerrno>
#include <cstring>
#include <ctime>  // linux/errqueue.h wants timespec
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <linux/errqueue.h>
#include <linux/net_tstamp.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/loop.hpp"
#include "source/can_port.hpp"
#include "source/can_stamp.hpp"

namespace gw {

namespace {

class SocketCan final : public CanPort {
public:
    SocketCan(const SourceConfig& config, std::vector<can_filter> filters) : config_(config), filters_(std::move(filters)) {
        memset(headers_, 0, sizeof headers_);
        for (int i = 0; i < kCanBatch; ++i) {
            vectors_[i] = {&frames_[i], sizeof frames_[i]};
            headers_[i].msg_hdr.msg_iov = &vectors_[i];
            headers_[i].msg_hdr.msg_iovlen = 1;
            headers_[i].msg_hdr.msg_control = control_[i];
        }
    }

    int open(std::string& error) override;
    void close() override { fd_.reset(); }
    int read(CanBatch& batch) override;
    bool send(const canfd_frame& frame, bool fd) override;
    std::string address() const override { return config_.interface; }
    const char* clock() const override { return stamps_.clock(); }
    void buffer(int64_t& asked, int64_t& granted) const override { asked = config_.buffer_bytes, granted = granted_; }

private:
    void options();

    SourceConfig config_;
    std::vector<can_filter> filters_;
    Fd fd_;
    CanStamps stamps_;
    int64_t granted_ = 0;
    canfd_frame frames_[kCanBatch];
    iovec vectors_[kCanBatch];
    mmsghdr headers_[kCanBatch];
    alignas(cmsghdr) char control_[kCanBatch][CMSG_SPACE(sizeof(scm_timestamping)) + CMSG_SPACE(sizeof(uint32_t)) + 64];
};

int SocketCan::open(std::string& error) {
    fd_.reset(socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW));
    if (!fd_) {
        const int why = errno;
        error = std::string("no CAN in this kernel or not permitted (") + strerror(why) + "); load the module can_raw, or use slcan or Modbus";
        return -1;
    }
    ifreq request{};
    strncpy(request.ifr_name, config_.interface.c_str(), IFNAMSIZ - 1);
    if (ioctl(fd_.get(), SIOCGIFINDEX, &request) < 0) {
        error = "interface " + config_.interface + ": " + strerror(errno) + "; ip link shows what there is";
        fd_.reset();
        return -1;
    }
    options();
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = request.ifr_ifindex;
    if (bind(fd_.get(), reinterpret_cast<sockaddr*>(&address), sizeof address) < 0) {
        error = "interface " + config_.interface + ": " + strerror(errno) + "; ip link set " + config_.interface + " up";
        fd_.reset();
        return -1;
    }
    stamps_.reopened();
    return fd_.get();
}

void SocketCan::options() {
    const int fd = fd_.get(), on = 1;
    const can_err_mask_t all_errors = CAN_ERR_MASK;
    setsockopt(fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &all_errors, sizeof all_errors);
    if (!filters_.empty() && filters_.size() <= CAN_RAW_FILTER_MAX)
        setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, filters_.data(), socklen_t(filters_.size() * sizeof(can_filter)));
    if (config_.fd) setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on);
    const int stamps = SOF_TIMESTAMPING_RX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE | SOF_TIMESTAMPING_RX_HARDWARE | SOF_TIMESTAMPING_RAW_HARDWARE;
    setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPING, &stamps, sizeof stamps);
    setsockopt(fd, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
    // The kernel doubles what is asked for its own book-keeping and reports the doubled figure.
    const int half = int(config_.buffer_bytes / 2);
    if (setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &half, sizeof half) < 0) setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &half, sizeof half);
    int granted = 0;
    socklen_t size = sizeof granted;
    getsockopt(fd, SOL_SOCKET, SO_RCVBUF, &granted, &size);
    granted_ = granted;
}

int SocketCan::read(CanBatch& b) {
    b.n = 0, b.dropped = 0, b.malformed = 0;
    for (auto& h : headers_) h.msg_hdr.msg_controllen = sizeof control_[0];
    const int n = recvmmsg(fd_.get(), headers_, kCanBatch, MSG_DONTWAIT, nullptr);
    b.clock_step_ns = stamps_.measure();
    if (n < 0) return errno == EAGAIN || errno == EINTR ? 0 : -errno;
    for (int i = 0; i < n; ++i) {
        driveid_stamp stamp;
        stamps_.read(headers_[i].msg_hdr, stamp, b.dropped);
        b.frame[b.n] = frames_[i];
        b.fd[b.n] = headers_[i].msg_len == CANFD_MTU;  // else CAN_MTU: a raw socket hands over no other size
        b.stamp[b.n] = stamp;
        ++b.n;
    }
    return 0;
}

bool SocketCan::send(const canfd_frame& frame, bool fd) {
    const size_t size = fd ? CANFD_MTU : CAN_MTU;
    return fd_ && ::send(fd_.get(), &frame, size, MSG_DONTWAIT | MSG_NOSIGNAL) == ssize_t(size);
}

}  // namespace

std::unique_ptr<CanPort> make_socketcan_port(const SourceConfig& config, std::vector<can_filter> filters) {
    return std::make_unique<SocketCan>(config, std::move(filters));
}

}  // namespace gw
