// SPDX-License-Identifier: Apache-2.0
// The event loop: epoll, timerfd, signalfd. One thread; handlers never block.
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

namespace gw {

class Fd {  // owns a descriptor
public:
    Fd() = default;
    explicit Fd(int fd) : fd_(fd) {}
    Fd(Fd&& o) noexcept : fd_(o.release()) {}
    Fd& operator=(Fd&& o) noexcept { if (this != &o) reset(o.release()); return *this; }
    ~Fd() { reset(); }
    int get() const { return fd_; }
    explicit operator bool() const { return fd_ >= 0; }
    int release() { int f = fd_; fd_ = -1; return f; }
    void reset(int fd = -1);

private:
    int fd_ = -1;
};

class Loop {
public:
    using Handler = std::function<void(uint32_t events)>;

    Loop();
    // events: EPOLLIN etc. The handler stays until remove(); removing inside a handler is allowed.
    void add(int fd, uint32_t events, Handler handler);
    void modify(int fd, uint32_t events);
    void remove(int fd);
    // Called before each wait; returns true where it has more work and the loop must not sleep.
    void idle(std::function<bool()> work) { idle_ = std::move(work); }
    void run();
    void stop() { running_ = false; }

private:
    struct Entry { int fd; Handler handler; bool dead; };
    Fd epoll_;
    std::vector<std::unique_ptr<Entry>> entries_;
    std::function<bool()> idle_;
    bool running_ = false;
    bool dead_seen_ = false;
};

class Timer {
public:
    Timer(Loop& loop, std::function<void()> action);
    ~Timer();
    Timer(const Timer&) = delete;
    void start(int64_t first_ns, int64_t period_ns);  // period 0: once
    void stop();

private:
    Loop& loop_;
    Fd fd_;
};

}  // namespace gw
