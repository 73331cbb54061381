// SPDX-License-Identifier: Apache-2.0
// Modbus TCP server of input registers. Framing, unit, function and address range are checked here, before modbus_reply sees a
// request: the library's own checks of Debian 12 (3.1.6) lack later fixes. Everything but "read input registers" is refused.
#include "sink/modbus_server.hpp"

#include <algorithm>
#include <arpa/inet.h>
#include <cerrno>
#include <cstring>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/epoll.h>
#include <sys/socket.h>

#include <modbus/modbus.h>

#include "base/clock.hpp"
#include "base/log.hpp"
#include "sink/layout.hpp"

namespace gw {

namespace {
constexpr size_t kAduMax = 260;
constexpr uint8_t kReadInput = 4;
constexpr int64_t kIdleNs = 300 * INT64_C(1000000000);

uint16_t be16(const uint8_t* p) { return uint16_t(p[0] << 8 | p[1]); }

void put_f32(uint16_t* r, double v) {
    const float f = float(v);
    uint32_t bits;
    memcpy(&bits, &f, 4);
    r[0] = uint16_t(bits >> 16), r[1] = uint16_t(bits);
}
}  // namespace

Adu modbus_adu(const uint8_t* data, size_t size, size_t& length) {
    if (size < 7) return Adu::incomplete;
    const uint16_t protocol = be16(data + 2), rest = be16(data + 4);
    if (protocol != 0 || rest < 2 || rest > kAduMax - 6) return Adu::broken;
    length = 6u + rest;
    return size >= length ? Adu::complete : Adu::incomplete;
}

uint8_t check_request(const uint8_t* adu, size_t length, int unit, int first, size_t registers) {
    if (adu[6] != unit) return MODBUS_EXCEPTION_GATEWAY_TARGET;
    if (adu[7] != kReadInput) return MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
    if (length != 12) return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
    const int address = be16(adu + 8), count = be16(adu + 10);
    if (count < 1 || count > 125) return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
    if (address < first || address + count > first + int(registers)) return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
    return 0;
}

size_t register_count(const std::vector<const Drive*>& drives) {
    size_t n = 0;
    for (auto* d : drives) n += kDriveHead + kParameterSize * d->parameters().size();
    return n;
}

void fill_registers(const std::vector<const Drive*>& drives, int64_t now_ns, std::vector<uint16_t>& out) {
    uint16_t* r = out.data();
    for (auto* d : drives) {
        r[0] = uint16_t(d->state(now_ns));
        r[1] = d->alarm();
        r[2] = uint16_t(std::min(d->rate_Hz() * 10, 65535.0));
        r[3] = uint16_t(d->parameters().size());
        r += kDriveHead;
        for (const auto& p : d->parameters()) {
            put_f32(r, p.known ? p.value : 0);
            put_f32(r + 2, p.known ? 0.5 * (p.hi - p.lo) : 0);
            r[4] = d->valid(p, now_ns);
            r[5] = p.known ? uint16_t(std::clamp(d->age_s(p, now_ns) * 10, 0.0, 65534.0)) : uint16_t(65535);
            r += kParameterSize;
        }
    }
}

namespace {

class ModbusServer final : public Sink {
public:
    ModbusServer(const SinkConfig& config, std::vector<const Drive*> drives, Loop& loop)
        : Sink(config), drives_(std::move(drives)), loop_(loop), retry_(loop, [this] { open(); }), registers_(register_count(drives_)) {
        context_ = modbus_new_tcp("127.0.0.1", 1502);  // only its reply encoder is used
    }
    ~ModbusServer() override {
        for (auto& c : clients_)
            if (c->fd) loop_.remove(c->fd.get());
        if (listener_) loop_.remove(listener_.get());
        modbus_free(context_);
    }
    void start() override { open(); }
    std::string address() const override { return config_.host + ":" + std::to_string(config_.port); }

private:
    struct Client {
        Fd fd;
        int64_t seen_ns = 0;
        size_t size = 0;
        uint8_t data[kAduMax];
    };

    void open();
    void accept_one();
    void readable(Client& c);
    bool reply(Client& c, size_t length);
    void close(Client& c) {
        loop_.remove(c.fd.get());
        c.fd.reset();
    }

    std::vector<const Drive*> drives_;
    Loop& loop_;
    Timer retry_;
    Fd listener_;
    modbus_t* context_;
    std::vector<uint16_t> registers_;
    std::vector<std::unique_ptr<Client>> clients_;
};

void ModbusServer::open() {
    const auto failed = [&](const char* mend) {
        status_.state = "closed";
        status_.last_error = strerror(errno);
        log_event(Level::warning, config_.name.c_str(), "listen", mend, "%s: %s", address().c_str(), strerror(errno));
        listener_.reset();
        retry_.start(2000000000, 0);
    };
    sockaddr_in a{};
    a.sin_family = AF_INET;
    a.sin_port = htons(uint16_t(config_.port));
    if (inet_pton(AF_INET, config_.host.c_str(), &a.sin_addr) != 1) {
        errno = EINVAL;
        return failed("host must be a numeric IPv4 address");
    }
    listener_.reset(socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    const int on = 1;
    if (listener_) setsockopt(listener_.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    if (!listener_ || bind(listener_.get(), reinterpret_cast<sockaddr*>(&a), sizeof a) < 0 || listen(listener_.get(), 8) < 0)
        return failed("choose a free port (above 1023 without root)");
    status_.state = "open";
    status_.last_error = "";
    loop_.add(listener_.get(), EPOLLIN, [this](uint32_t) { accept_one(); });
}

void ModbusServer::accept_one() {
    Fd fd(accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (!fd) return;
    const int64_t now = monotonic_ns();
    for (auto& c : clients_)
        if (c->fd && now - c->seen_ns > kIdleNs) close(*c);  // peers that are gone without a word
    std::erase_if(clients_, [](auto& c) { return !c->fd; });
    if (clients_.size() >= size_t(config_.clients)) {
        ++status_.dropped;
        log_event(Level::warning, config_.name.c_str(), "clients", "close one or raise clients", "more connections than clients allows: refused");
        return;
    }
    const int on = 1;
    setsockopt(fd.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    clients_.push_back(std::make_unique<Client>());
    Client* c = clients_.back().get();
    c->fd = std::move(fd);
    c->seen_ns = now;
    loop_.add(c->fd.get(), EPOLLIN, [this, c](uint32_t) {
        if (c->fd) readable(*c);
    });
}

void ModbusServer::readable(Client& c) {
    const ssize_t n = recv(c.fd.get(), c.data + c.size, sizeof c.data - c.size, MSG_DONTWAIT);
    if (n < 0 && (errno == EAGAIN || errno == EINTR)) return;
    if (n <= 0) return close(c);
    c.seen_ns = monotonic_ns();
    c.size += size_t(n);
    size_t length = 0;
    Adu adu;
    while ((adu = modbus_adu(c.data, c.size, length)) == Adu::complete) {
        if (!reply(c, length)) return close(c);
        c.size -= length;
        memmove(c.data, c.data + length, c.size);
    }
    if (adu == Adu::broken) {
        log_event(Level::warning, config_.name.c_str(), "adu", "", "a peer sent what is no Modbus TCP: connection closed");
        close(c);
    }
}

// False where the connection is to be closed (a peer that does not read its replies).
bool ModbusServer::reply(Client& c, size_t length) {
    modbus_set_socket(context_, c.fd.get());
    const uint8_t exception = check_request(c.data, length, int(config_.unit), int(config_.address), registers_.size());
    if (exception != 0) {
        ++status_.dropped;
        const uint8_t refusal[9] = {c.data[0], c.data[1], 0, 0, 0, 3, c.data[6], uint8_t(c.data[7] | 0x80), exception};
        return send(c.fd.get(), refusal, sizeof refusal, MSG_DONTWAIT | MSG_NOSIGNAL) == ssize_t(sizeof refusal);
    }
    fill_registers(drives_, monotonic_ns(), registers_);
    modbus_mapping_t map{};
    map.start_input_registers = int(config_.address);
    map.nb_input_registers = int(registers_.size());
    map.tab_input_registers = registers_.data();
    modbus_set_slave(context_, c.data[6]);
    if (modbus_reply(context_, c.data, int(length), &map) < 0) return false;
    ++status_.sent;
    return true;
}

}  // namespace

std::unique_ptr<Sink> make_modbus_server(const SinkConfig& config, std::vector<const Drive*> drives, Loop& loop) {
    return std::make_unique<ModbusServer>(config, std::move(drives), loop);
}

}  // namespace gw
