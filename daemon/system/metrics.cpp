// SPDX-License-Identifier: Apache-2.0
#include "system/metrics.hpp"

#include <arpa/inet.h>
#include <cerrno>
#include <cstring>
#include <netinet/in.h>
#include <stdexcept>
#include <sys/epoll.h>
#include <sys/socket.h>

#include "base/clock.hpp"
#include "control/server.hpp"

namespace gw {

namespace {
constexpr size_t kClients = 4, kRequestMax = 4096;

void line(std::string& out, const char* name, const std::string& labels, double v) {
    char number[40];
    snprintf(number, sizeof number, "%.17g", v);
    out += std::string(name) + "{" + labels + "} " + number + "\n";
}

std::string label(const char* key, const std::string& value) { return std::string(key) + "=\"" + value + "\""; }
}  // namespace

Metrics::Metrics(const std::string& address, Loop& loop, Commands& commands) : loop_(loop), commands_(commands) {
    const size_t colon = address.rfind(':');
    sockaddr_in a{};
    a.sin_family = AF_INET;
    a.sin_port = htons(uint16_t(atoi(address.c_str() + colon + 1)));
    if (inet_pton(AF_INET, address.substr(0, colon).c_str(), &a.sin_addr) != 1) throw std::runtime_error("system.metrics: \"" + address + "\" must be like 127.0.0.1:9464");
    listener_.reset(socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    const int on = 1;
    setsockopt(listener_.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    if (bind(listener_.get(), reinterpret_cast<sockaddr*>(&a), sizeof a) < 0 || listen(listener_.get(), 4) < 0)
        throw std::runtime_error("system.metrics " + address + ": " + strerror(errno) + "; choose a free port");
    loop_.add(listener_.get(), EPOLLIN, [this](uint32_t) { accept_one(); });
}

Metrics::~Metrics() {
    for (auto& c : clients_)
        if (c->fd) loop_.remove(c->fd.get());
    loop_.remove(listener_.get());
}

void Metrics::accept_one() {
    Fd fd(accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    std::erase_if(clients_, [](auto& c) { return !c->fd; });
    if (!fd) return;
    if (clients_.size() >= kClients) {  // the oldest one hangs
        loop_.remove(clients_.front()->fd.get());
        clients_.front()->fd.reset();
    }
    clients_.push_back(std::make_unique<Client>());
    Client* c = clients_.back().get();
    c->fd = std::move(fd);
    loop_.add(c->fd.get(), EPOLLIN, [this, c](uint32_t) {
        if (c->fd) readable(*c);
    });
}

void Metrics::readable(Client& c) {
    char buffer[1024];
    const ssize_t n = recv(c.fd.get(), buffer, sizeof buffer, MSG_DONTWAIT);
    if (n < 0 && (errno == EAGAIN || errno == EINTR)) return;
    if (n > 0) c.input.append(buffer, size_t(n));
    const bool whole = c.input.find("\r\n\r\n") != std::string::npos || c.input.find("\n\n") != std::string::npos;
    if (n > 0 && !whole && c.input.size() <= kRequestMax) return;
    if (whole) {
        const std::string body = c.input.starts_with("GET /metrics ") ? page() : "";
        const std::string answer = std::string(body.empty() ? "HTTP/1.1 404 Not Found" : "HTTP/1.1 200 OK") +
                                   "\r\nContent-Type: text/plain; version=0.0.4\r\nConnection: close\r\nContent-Length: " + std::to_string(body.size()) + "\r\n\r\n" + body;
        if (send(c.fd.get(), answer.data(), answer.size(), MSG_DONTWAIT | MSG_NOSIGNAL) < 0) { /* the peer is gone */ }
    }
    loop_.remove(c.fd.get());
    c.fd.reset();
}

std::string Metrics::page() const {
    std::string out;
    Gateway& g = commands_.gateway();
    const int64_t now = monotonic_ns();
    line(out, "driveid_uptime_seconds", "", commands_.uptime_s());
    for (auto& s : g.sources()) {
        const std::string l = label("source", s->config().name);
        const SourceStatus& st = s->status();
        line(out, "driveid_source_frames_total", l, double(st.frames));
        line(out, "driveid_source_used_total", l, double(st.used));
        line(out, "driveid_source_rejected_total", l, double(st.rejected));
        line(out, "driveid_source_dropped_total", l, double(st.dropped));
        line(out, "driveid_source_errors_total", l, double(st.errors));
        line(out, "driveid_source_up", l, st.state == "open");
    }
    for (auto& d : g.drives()) {
        const std::string l = label("drive", d->config().name);
        line(out, "driveid_drive_samples_total", l, double(d->samples()));
        line(out, "driveid_drive_gaps_total", l, double(d->counters().gaps));
        line(out, "driveid_drive_alarm", l, d->alarm());
        for (const auto& p : d->parameters()) {
            const std::string lp = l + "," + label("parameter", p.name);
            line(out, "driveid_parameter_valid", lp, d->valid(p, now));
            if (!p.known) continue;
            line(out, "driveid_parameter", lp, p.value);
            line(out, "driveid_parameter_half_width", lp, 0.5 * (p.hi - p.lo));
            line(out, "driveid_parameter_age_seconds", lp, d->age_s(p, now));
        }
    }
    return out;
}

}  // namespace gw
