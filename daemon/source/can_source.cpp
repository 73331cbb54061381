// SPDX-License-Identifier: Apache-2.0
#include "source/can_source.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <linux/can/error.h>
#include <poll.h>
#include <sys/epoll.h>

#include "base/log.hpp"

namespace gw {

namespace {
constexpr int64_t kFirstBackoffNs = 100000000, kLongestBackoffNs = 5000000000;
constexpr int kBatchesATurn = 4;  // then the other descriptors get theirs

const char* bus_state_of(const canfd_frame& f) {
    if (f.can_id & CAN_ERR_BUSOFF) return "bus-off";
    if (f.can_id & CAN_ERR_RESTARTED) return "active";
    if (f.can_id & CAN_ERR_CRTL) {
        const uint8_t c = f.data[1];
        if (c & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) return "passive";
        if (c & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) return "warning";
        if (c & CAN_ERR_CRTL_ACTIVE) return "active";
    }
    return nullptr;
}

const char* mend_of(const char* state) {
    if (strcmp(state, "bus-off") == 0) return "check wiring, termination and bit rate; ip link set IFACE type can restart-ms 100";
    if (strcmp(state, "passive") == 0) return "check wiring and that another node acknowledges";
    return "";
}
}  // namespace

CanSource::CanSource(const SourceConfig& config, int index, Consumer& consumer, Loop& loop, std::unique_ptr<CanPort> port)
    : Source(config, index, consumer), loop_(loop), port_(std::move(port)), retry_(loop, [this] { open(); }), backoff_ns_(kFirstBackoffNs) {}

CanSource::~CanSource() {
    if (fd_ >= 0) loop_.remove(fd_);
    port_->close();
}

bool CanSource::waiting() const {
    pollfd p{fd_, POLLIN, 0};
    return fd_ >= 0 && ::poll(&p, 1, 0) > 0 && p.revents & POLLIN;
}

void CanSource::open() {
    std::string error;
    fd_ = port_->open(error);
    if (fd_ < 0) {
        status_.state = "closed";
        status_.last_error = error;
        log_event(Level::warning, config_.name.c_str(), "open", "it is tried again", "%s", error.c_str());
        return again();
    }
    port_->buffer(status_.buffer_asked, status_.buffer_granted);
    status_.state = "open";
    ++status_.reopened;
    if (status_.bus_state.empty() || status_.bus_state == "down") status_.bus_state = "active";
    loop_.add(fd_, EPOLLIN, [this](uint32_t) { readable(); });
    log_event(Level::info, config_.name.c_str(), "opened", "", "%s open; receive buffer asked %lld, granted %lld byte", address().c_str(),
              (long long)status_.buffer_asked, (long long)status_.buffer_granted);
    if (status_.buffer_granted < status_.buffer_asked)
        log_event(Level::warning, config_.name.c_str(), "buffer", "run as root once, or raise net.core.rmem_max", "receive buffer is smaller than asked");
}

void CanSource::again() {
    retry_.start(backoff_ns_, 0);
    backoff_ns_ = std::min(backoff_ns_ * 2, kLongestBackoffNs);
}

void CanSource::lost(int error_number) {
    loop_.remove(fd_);
    fd_ = -1;
    port_->close();
    status_.state = error_number == ENETDOWN ? "down" : "closed";
    status_.bus_state = "down";
    status_.last_error = strerror(error_number);
    log_event(Level::warning, config_.name.c_str(), "lost", error_number == ENETDOWN ? "ip link set IFACE up; it is opened again by itself" : "it is opened again by itself",
              "%s: %s", address().c_str(), strerror(error_number));
    consumer_.on_gap(index_, 0);
    again();
}

void CanSource::readable() {
    for (int k = 0; k < kBatchesATurn; ++k) {
        const int rc = port_->read(batch_);
        if (rc < 0) return lost(-rc);
        if (batch_.clock_step_ns != 0)
            log_event(Level::warning, config_.name.c_str(), "clock-step", "", "wall clock stepped by %lld ms; stamps stay monotonic", (long long)(batch_.clock_step_ns / 1000000));
        take(batch_);
        if (batch_.n < kCanBatch) return;
    }
}

void CanSource::take(const CanBatch& b) {
    if (b.dropped > 0) {
        status_.dropped += b.dropped;
        consumer_.on_gap(index_, b.dropped);
        log_event(Level::warning, config_.name.c_str(), "dropped", "raise buffer_bytes or lighten the machine", "the kernel dropped %llu frames", (unsigned long long)b.dropped);
    }
    for (uint64_t i = 0; i < b.malformed; ++i) count(Fate::rejected);
    if (b.n > 0) {
        backoff_ns_ = kFirstBackoffNs;
        status_.clock = port_->clock();
    }
    for (int i = 0; i < b.n; ++i) {
        const canfd_frame& f = b.frame[i];
        if (f.can_id & CAN_ERR_FLAG) {
            error_frame(f);
            continue;
        }
        const bool too_long = f.len > (b.fd[i] ? CANFD_MAX_DLEN : CAN_MAX_DLEN);
        if (too_long || (b.fd[i] && !config_.fd)) {
            count(Fate::rejected);
            log_event(Level::warning, config_.name.c_str(), "fd", "set fd = true for this source", "frame 0x%X is no classic frame", f.can_id & CAN_EFF_MASK);
            continue;
        }
        count(consumer_.on_frame(index_, f, b.fd[i], b.stamp[i]));
    }
}

void CanSource::error_frame(const canfd_frame& f) {
    ++status_.errors;
    if (f.can_id & CAN_ERR_CRTL && f.data[1] & (CAN_ERR_CRTL_RX_OVERFLOW)) {
        consumer_.on_gap(index_, 0);
        log_event(Level::warning, config_.name.c_str(), "overflow", "the controller lost frames: lighten the machine", "controller receive overflow");
    }
    const char* state = bus_state_of(f);
    if (!state || status_.bus_state == state) return;
    status_.bus_state = state;
    log_event(strcmp(state, "active") ? Level::warning : Level::info, config_.name.c_str(), "bus-state", mend_of(state), "bus state %s", state);
}

bool CanSource::send(const canfd_frame& frame, bool fd) { return fd_ >= 0 && (!fd || config_.fd) && port_->send(frame, fd); }

}  // namespace gw
