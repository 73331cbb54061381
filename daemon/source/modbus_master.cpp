// SPDX-License-Identifier: Apache-2.0
#include "source/modbus_master.hpp"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <map>
#include <mutex>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <signal.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <thread>
#include <unistd.h>

#include <modbus/modbus.h>

#include "base/clock.hpp"
#include "base/log.hpp"
#include "base/spsc.hpp"

namespace gw {

namespace {

constexpr int64_t kFirstBackoffNs = 100000000, kLongestBackoffNs = 5000000000;
constexpr size_t kQueue = 256;

struct Message {
    enum Kind { reply, failure, opened, missed } kind = reply;
    ModbusReply data{};
    driveid_stamp stamp{};
    char text[120] = "";
};

// One device behind a line.
struct Device {
    Device(const SourceConfig& c, std::vector<RegisterBlock> p) : config(c), plan(std::move(p)), queue(kQueue), wake(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {}
    SourceConfig config;
    std::vector<RegisterBlock> plan;
    Spsc<Message> queue;
    Fd wake;
    std::atomic<uint64_t> lost{0};        // replies that the main thread was too slow for
    int64_t due_ns = 0, backoff_ns = 0;
    std::atomic<bool> off{false};         // its source is gone: not polled any more

    void tell(const Message& m) {
        if (!queue.push(m)) ++lost;
        const uint64_t one = 1;
        if (write(wake.get(), &one, sizeof one) < 0) { /* the counter is full: the reader is awake */ }
    }
};

// The line: a TCP connection or a serial port, with a thread that polls its devices one after another.
class Line {
public:
    explicit Line(bool serial) : serial_(serial), stop_fd_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {}
    ~Line() { stop(); }

    bool started() const { return thread_.joinable(); }  // then it takes no further devices
    void add(std::shared_ptr<Device> device) { devices_.push_back(std::move(device)); }
    void start() {
        if (thread_.joinable()) return;
        sigset_t all, old;
        sigfillset(&all);
        pthread_sigmask(SIG_SETMASK, &all, &old);  // signals belong to the main thread
        thread_ = std::thread([this] { work(); });
        pthread_sigmask(SIG_SETMASK, &old, nullptr);
    }
    void stop() {
        const uint64_t one = 1;
        if (write(stop_fd_.get(), &one, sizeof one) < 0) { /* it is set already */ }
        if (thread_.joinable()) thread_.join();
    }

private:
    void work();
    bool rest(int64_t until_ns);           // false where it shall stop
    void poll(Device& d);
    bool open(Device& d);
    bool open_tcp(Device& d);
    bool open_serial_line(Device& d);
    void close();
    bool read(Device& d, const RegisterBlock& b);
    void failed(Device& d, const char* what, int error);
    void silence();

    bool serial_;
    Fd stop_fd_;
    std::vector<std::shared_ptr<Device>> devices_;
    std::thread thread_;
    modbus_t* context_ = nullptr;
    int64_t last_byte_ns_ = 0;
};

bool Line::rest(int64_t until_ns) {
    pollfd p{stop_fd_.get(), POLLIN, 0};
    const int64_t left = until_ns - monotonic_ns();
    const timespec t{left > 0 ? left / 1000000000 : 0, left > 0 ? left % 1000000000 : 0};
    return ppoll(&p, 1, &t, nullptr) <= 0;
}

void Line::work() {
    for (auto& d : devices_) d->due_ns = monotonic_ns();
    while (true) {
        Device* next = nullptr;
        for (auto& d : devices_)
            if (!d->off && (!next || d->due_ns < next->due_ns)) next = d.get();
        if (!rest(next ? next->due_ns : monotonic_ns() + 100000000)) break;
        if (next) poll(*next);
    }
    close();
}

void Line::poll(Device& d) {
    const int64_t period = int64_t(d.config.poll_s * 1e9);
    if (!context_ && !open(d)) return;
    if (serial_ && modbus_set_slave(context_, int(d.config.unit)) < 0) return failed(d, "unit", errno);
    for (const auto& block : d.plan)
        if (!read(d, block)) return;
    d.backoff_ns = 0;
    d.due_ns += period;
    const int64_t now = monotonic_ns();
    if (now > d.due_ns + period) {  // too late for the next one as well: those polls are left out, not made up for
        const int64_t left_out = (now - d.due_ns) / period;
        d.due_ns += left_out * period;
        Message m;
        m.kind = Message::missed;
        d.tell(m);
    }
}

// A device that fails waits; the others on its line go on.
void Line::failed(Device& d, const char* what, int error) {
    Message m;
    m.kind = Message::failure;
    snprintf(m.text, sizeof m.text, "%s: %s", what, error == 0 ? "no route" : modbus_strerror(error));
    d.tell(m);
    d.backoff_ns = std::clamp(d.backoff_ns * 2, kFirstBackoffNs, kLongestBackoffNs);
    d.due_ns = monotonic_ns() + d.backoff_ns;
}

bool Line::open(Device& d) {
    if (!(serial_ ? open_serial_line(d) : open_tcp(d))) return false;
    modbus_set_response_timeout(context_, uint32_t(d.config.timeout_s), uint32_t((d.config.timeout_s - double(uint32_t(d.config.timeout_s))) * 1e6));
    modbus_set_byte_timeout(context_, 0, 0);  // the response time-out governs the whole reply: no dripping
    modbus_set_error_recovery(context_, MODBUS_ERROR_RECOVERY_NONE);
    modbus_set_slave(context_, int(d.config.unit));
    Message m;
    m.kind = Message::opened;
    d.tell(m);
    return true;
}

bool Line::open_tcp(Device& d) {
    char port[8];
    snprintf(port, sizeof port, "%d", int(d.config.port));
    addrinfo hints{}, *found = nullptr;
    hints.ai_family = AF_INET, hints.ai_socktype = SOCK_STREAM, hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV;
    if (getaddrinfo(d.config.host.c_str(), port, &hints, &found) != 0) {
        failed(d, "host must be a numeric IPv4 address", EINVAL);
        return false;
    }
    Fd fd(socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    int error = fd ? 0 : errno;
    if (fd && connect(fd.get(), found->ai_addr, found->ai_addrlen) < 0) error = errno;
    freeaddrinfo(found);
    if (error == EINPROGRESS) {
        pollfd p[2] = {{fd.get(), POLLOUT, 0}, {stop_fd_.get(), POLLIN, 0}};
        error = ::poll(p, 2, int(d.config.timeout_s * 1000) + 1) > 0 ? 0 : ETIMEDOUT;
        socklen_t size = sizeof error;
        if (error == 0) getsockopt(fd.get(), SOL_SOCKET, SO_ERROR, &error, &size);
        if (p[1].revents) error = ECANCELED;
    }
    if (error == 0 && fd.get() >= FD_SETSIZE) error = EMFILE;  // libmodbus selects
    if (error == 0 && !(context_ = modbus_new_tcp("127.0.0.1", int(d.config.port)))) error = errno;
    if (error != 0) {
        failed(d, "connect", error);
        return false;
    }
    const int on = 1;
    setsockopt(fd.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    fcntl(fd.get(), F_SETFL, fcntl(fd.get(), F_GETFL) & ~O_NONBLOCK);
    modbus_set_socket(context_, fd.release());
    return true;
}

bool Line::open_serial_line(Device& d) {
    const char parity = d.config.parity == "even" ? 'E' : d.config.parity == "odd" ? 'O' : 'N';
    // Without parity a second stop bit keeps the character at 11 bits, as the standard asks.
    context_ = modbus_new_rtu(d.config.device.c_str(), int(d.config.baud), parity, 8, parity == 'N' ? 2 : 1);
    if (!context_) return failed(d, d.config.device.c_str(), errno), false;
    modbus_set_slave(context_, int(d.config.unit));
    if (modbus_connect(context_) < 0) {
        const int why = errno;
        modbus_free(context_);
        context_ = nullptr;
        for (auto& other : devices_)
            if (other.get() != &d && !other->off) failed(*other, other->config.device.c_str(), why);
        return failed(d, d.config.device.c_str(), why), false;
    }
    if (d.config.rs485 && modbus_rtu_set_serial_mode(context_, MODBUS_RTU_RS485) < 0) {
        const int why = errno;
        close();
        return failed(d, "the port refuses RS-485 mode; remove rs485 where the adapter switches by itself", why), false;
    }
    modbus_flush(context_);
    return true;
}

void Line::close() {
    if (!context_) return;
    modbus_close(context_);
    modbus_free(context_);
    context_ = nullptr;
}

// RTU: 3.5 characters of silence before a request; 1.75 ms above 19200 bit/s.
void Line::silence() {
    if (!serial_) return;
    const long baud = long(devices_.front()->config.baud);
    const int64_t gap = baud > 19200 ? 1750000 : int64_t(38.5e9 / double(baud));
    const int64_t wait = last_byte_ns_ + gap - monotonic_ns();
    if (wait > 0) {
        const timespec t{wait / 1000000000, wait % 1000000000};
        nanosleep(&t, nullptr);
    }
}

bool Line::read(Device& d, const RegisterBlock& b) {
    Message m;
    silence();
    if (serial_) modbus_flush(context_);  // what a late peer still said belongs to no request
    const int64_t before = monotonic_ns();
    errno = 0;
    const int n = b.holding ? modbus_read_registers(context_, b.address, b.count, m.data.registers) : modbus_read_input_registers(context_, b.address, b.count, m.data.registers);
    const int why = errno;
    const int64_t after = monotonic_ns();
    last_byte_ns_ = after;
    if (n == b.count) {
        m.data.unit = uint8_t(d.config.unit), m.data.function = b.holding ? 3 : 4;
        m.data.address = b.address, m.data.count = b.count;
        m.stamp = {before + (after - before) / 2, (after - before) / 2, DRIVEID_CLOCK_DAEMON};
        d.tell(m);
        return true;
    }
    const bool answered = why >= EMBXILFUN && why <= EMBXGTAR;  // an exception: the connection is in step
    if (!answered && !serial_) close();                        // after a time-out or a wrong answer a new connection is the only one in step
    if (!answered && serial_ && why != ETIMEDOUT && why < MODBUS_ENOBASE) close();  // the port itself is gone
    failed(d, "read", why);
    return false;
}

class ModbusMaster final : public Source {
public:
    ModbusMaster(const SourceConfig& config, int index, Consumer& consumer, Loop& loop, std::shared_ptr<Line> line, std::shared_ptr<Device> device)
        : Source(config, index, consumer), loop_(loop), line_(std::move(line)), device_(std::move(device)) {
        loop_.add(device_->wake.get(), EPOLLIN, [this](uint32_t) { take(); });
    }
    ~ModbusMaster() override {
        device_->off = true;
        loop_.remove(device_->wake.get());
    }
    void start() override {
        status_.state = "connecting";
        status_.clock = "daemon";
        line_->start();
    }
    bool waiting() const override { return !device_->queue.empty(); }
    std::string address() const override {
        return config_.kind == "modbus_rtu" ? config_.device + " unit " + std::to_string(config_.unit)
                                            : config_.host + ":" + std::to_string(config_.port) + " unit " + std::to_string(config_.unit);
    }

private:
    void take() {
        uint64_t n;
        if (::read(device_->wake.get(), &n, sizeof n) < 0) { /* woken without need */ }
        if (const uint64_t lost = device_->lost.exchange(0); lost > 0) {
            status_.dropped += lost;
            consumer_.on_gap(index_, lost);
        }
        Message m;
        while (device_->queue.pop(m)) handle(m);
    }
    void handle(const Message& m) {
        switch (m.kind) {
            case Message::reply:
                if (!alive_) {
                    alive_ = true;
                    status_.state = "open";
                    log_event(Level::info, config_.name.c_str(), "answers", "", "%s answers", address().c_str());
                }
                return count(consumer_.on_reply(index_, m.data, m.stamp));
            case Message::opened:
                ++status_.reopened;
                return;
            case Message::missed:
                ++missed_;
                log_event(Level::warning, config_.name.c_str(), "missed", "raise poll_s", "the device is slower than poll_s: polls left out");
                return;
            case Message::failure:
                ++status_.errors;
                status_.state = "down";
                status_.last_error = m.text;
                if (alive_) consumer_.on_gap(index_, 0);
                alive_ = false;
                log_event(Level::warning, config_.name.c_str(), "failure", "check the device and its address; it is tried again", "%s: %s", address().c_str(), m.text);
        }
    }

    Loop& loop_;
    std::shared_ptr<Line> line_;
    std::shared_ptr<Device> device_;
    bool alive_ = false;
    uint64_t missed_ = 0;
};

// Serial ports that are open, so that units on one port share its line.
std::map<std::string, std::weak_ptr<Line>>& serial_lines() {
    static std::map<std::string, std::weak_ptr<Line>> lines;
    return lines;
}

}  // namespace

std::unique_ptr<Source> make_modbus_master(const Config& config, int index, Consumer& consumer, Loop& loop) {
    const SourceConfig& c = config.sources[size_t(index)];
    const bool serial = c.kind == "modbus_rtu";
    auto device = std::make_shared<Device>(c, plan_reads(config, c));
    std::shared_ptr<Line> line;
    if (serial) line = serial_lines()[c.device].lock();
    if (!line || line->started()) line = std::make_shared<Line>(serial);
    if (serial) serial_lines()[c.device] = line;
    line->add(device);
    return std::make_unique<ModbusMaster>(c, index, consumer, loop, std::move(line), std::move(device));
}

}  // namespace gw
