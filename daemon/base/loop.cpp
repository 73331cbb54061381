// SPDX-License-Identifier: Apache-2.0
#include "base/loop.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <sys/epoll.h>
#include <sys/timerfd.h>
#include <unistd.h>

namespace gw {

void Fd::reset(int fd) {
    if (fd_ >= 0) ::close(fd_);
    fd_ = fd;
}

Loop::Loop() : epoll_(epoll_create1(EPOLL_CLOEXEC)) {
    if (!epoll_) throw std::runtime_error(std::string("epoll_create1: ") + strerror(errno));
}

void Loop::add(int fd, uint32_t events, Handler handler) {
    entries_.push_back(std::make_unique<Entry>(Entry{fd, std::move(handler), false}));
    epoll_event e{};
    e.events = events;
    e.data.ptr = entries_.back().get();
    if (epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd, &e) < 0) {
        const int err = errno;
        entries_.pop_back();
        throw std::runtime_error(std::string("epoll_ctl: ") + strerror(err));
    }
}

void Loop::modify(int fd, uint32_t events) {
    for (auto& entry : entries_) {
        if (entry->fd != fd || entry->dead) continue;
        epoll_event e{};
        e.events = events;
        e.data.ptr = entry.get();
        epoll_ctl(epoll_.get(), EPOLL_CTL_MOD, fd, &e);
    }
}

void Loop::remove(int fd) {
    for (auto& entry : entries_) {
        if (entry->fd != fd || entry->dead) continue;
        epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, fd, nullptr);
        entry->dead = true;
        dead_seen_ = true;
    }
}

void Loop::run() {
    running_ = true;
    epoll_event ready[32];
    while (running_) {
        const bool more = idle_ && idle_();
        if (!running_) break;
        const int n = epoll_wait(epoll_.get(), ready, 32, more ? 0 : -1);
        for (int i = 0; i < n && running_; ++i) {
            auto* entry = static_cast<Entry*>(ready[i].data.ptr);
            if (!entry->dead) entry->handler(ready[i].events);
        }
        if (dead_seen_) {
            std::erase_if(entries_, [](const auto& e) { return e->dead; });
            dead_seen_ = false;
        }
    }
}

Timer::Timer(Loop& loop, std::function<void()> action)
    : loop_(loop), fd_(timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC)) {
    if (!fd_) throw std::runtime_error(std::string("timerfd_create: ") + strerror(errno));
    loop_.add(fd_.get(), EPOLLIN, [this, action = std::move(action)](uint32_t) {
        uint64_t expired;
        if (read(fd_.get(), &expired, sizeof expired) == sizeof expired) action();
    });
}

Timer::~Timer() { loop_.remove(fd_.get()); }

void Timer::start(int64_t first_ns, int64_t period_ns) {
    first_ns = std::max<int64_t>(first_ns, 1);
    itimerspec spec{};
    spec.it_value = {first_ns / 1000000000, first_ns % 1000000000};
    spec.it_interval = {period_ns / 1000000000, period_ns % 1000000000};
    timerfd_settime(fd_.get(), 0, &spec, nullptr);
}

void Timer::stop() {
    itimerspec spec{};
    timerfd_settime(fd_.get(), 0, &spec, nullptr);
}

}  // namespace gw
