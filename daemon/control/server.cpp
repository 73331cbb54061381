// SPDX-License-Identifier: Apache-2.0
#include "control/server.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <grp.h>
#include <stdexcept>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <driveid/version.h>

#include "base/clock.hpp"
#include "control/describe.hpp"

namespace gw {

bool Subscription::wants(const std::string& drive) const {
    return drives.empty() || std::find(drives.begin(), drives.end(), drive) != drives.end();
}

bool Subscription::due(int drive) {
    if (phase.size() <= size_t(drive)) phase.resize(size_t(drive) + 1, decimate - 1);
    if (++phase[size_t(drive)] < decimate) return false;
    phase[size_t(drive)] = 0;
    return true;
}

struct ControlServer::Client {
    Client(Fd descriptor, bool write, size_t bytes) : fd(std::move(descriptor)), may_write(write), queue(bytes) { input.reserve(4096); }
    Fd fd;
    bool may_write, waiting = false, dead = false;
    std::string input;
    LineQueue queue;
    Subscription subscription;
};

ControlServer::ControlServer(const ControlConfig& config, Loop& loop, Commands& commands) : config_(config), loop_(loop), commands_(commands) {}

ControlServer::~ControlServer() {
    for (auto& c : clients_)
        if (!c->dead) loop_.remove(c->fd.get());
    if (listener_) loop_.remove(listener_.get());
    if (bound_) unlink(config_.socket.c_str());
}

void ControlServer::start() {
    if (config_.socket.empty()) return;
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (config_.socket.size() >= sizeof address.sun_path) throw std::runtime_error("control.socket: path is longer than 107 characters; shorten it");
    memcpy(address.sun_path, config_.socket.c_str(), config_.socket.size() + 1);
    const auto fail = [&](const char* mend) { throw std::runtime_error("control socket " + config_.socket + ": " + strerror(errno) + "; " + mend); };
    listener_.reset(socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    if (!listener_) fail("raise the limit of descriptors");
    // A socket that still answers belongs to a living daemon.
    if (connect(listener_.get(), reinterpret_cast<sockaddr*>(&address), sizeof address) == 0)
        throw std::runtime_error("control socket " + config_.socket + " is in use by another daemon; stop it or choose another path");
    listener_.reset(socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    struct stat old;
    if (lstat(config_.socket.c_str(), &old) == 0) {
        if (!S_ISSOCK(old.st_mode)) throw std::runtime_error("control socket " + config_.socket + ": a file of this name is there and is no socket; choose another path");
        unlink(config_.socket.c_str());
    }
    const mode_t mask = umask(0177);
    const int rc = bind(listener_.get(), reinterpret_cast<sockaddr*>(&address), sizeof address);
    umask(mask);
    if (rc < 0) fail("create its folder and allow the daemon to write there");
    bound_ = true;
    if (!config_.group.empty()) {
        const group* g = getgrnam(config_.group.c_str());
        if (!g || chown(config_.socket.c_str(), uid_t(-1), g->gr_gid) < 0) throw std::runtime_error("control.group: \"" + config_.group + "\" does not exist or may not be given; mend it");
    }
    if (!config_.write_group.empty()) {
        const group* g = getgrnam(config_.write_group.c_str());
        if (!g) throw std::runtime_error("control.write_group: \"" + config_.write_group + "\" does not exist; create it or mend the name");
        write_gid_ = long(g->gr_gid);
    }
    chmod(config_.socket.c_str(), mode_t(strtol(config_.mode.c_str(), nullptr, 8)));
    if (listen(listener_.get(), 128) < 0) fail("choose another path");
    loop_.add(listener_.get(), EPOLLIN, [this](uint32_t) { accept_one(); });
}

// The peer's own group or one of its supplementary groups.
bool ControlServer::may_write(int fd) const {
    if (write_gid_ < 0) return false;
    ucred peer{};
    socklen_t size = sizeof peer;
    if (getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &size) < 0) return false;
    if (long(peer.gid) == write_gid_) return true;
    gid_t groups[256];
    size = sizeof groups;
    if (getsockopt(fd, SOL_SOCKET, SO_PEERGROUPS, groups, &size) < 0) return false;
    return std::any_of(groups, groups + size / sizeof(gid_t), [&](gid_t g) { return long(g) == write_gid_; });
}

void ControlServer::accept_one() {
    Fd fd(accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (!fd) {
        if (errno == EMFILE || errno == ENFILE) {
            log_event(Level::error, "control", "descriptors", "raise LimitNOFILE", "out of descriptors");
            usleep(1000);  // the listener stays readable: no busy loop
        }
        return;
    }
    std::erase_if(clients_, [](auto& c) { return c->dead; });
    if (clients_.size() >= size_t(config_.clients)) {
        static const char text[] = "{\"driveid\":1,\"id\":null,\"ok\":false,\"error\":\"busy\",\"message\":\"too many connections; close one or raise control.clients\"}\n";
        if (::send(fd.get(), text, sizeof text - 1, MSG_NOSIGNAL | MSG_DONTWAIT) < 0) { /* it learns from the end of the connection */ }
        return;
    }
    clients_.push_back(std::make_unique<Client>(std::move(fd), false, size_t(config_.queue_bytes)));
    Client* c = clients_.back().get();
    c->may_write = may_write(c->fd.get());
    loop_.add(c->fd.get(), EPOLLIN, [this, c](uint32_t events) {
        if (events & EPOLLOUT) flush(*c);
        if (!c->dead && events & (EPOLLIN | EPOLLHUP | EPOLLERR)) readable(*c);
    });
}

void ControlServer::close(Client& c) {
    if (c.dead) return;
    loop_.remove(c.fd.get());
    c.fd.reset();
    c.dead = true;
}

void ControlServer::readable(Client& c) {
    char buffer[8192];
    const ssize_t n = recv(c.fd.get(), buffer, sizeof buffer, MSG_DONTWAIT);
    if (n < 0 && (errno == EAGAIN || errno == EINTR)) return;
    if (n <= 0) return close(c);
    c.input.append(buffer, size_t(n));
    size_t start = 0;
    for (size_t end; (end = c.input.find('\n', start)) != std::string::npos && !c.dead; start = end + 1) {
        const std::string_view line(c.input.data() + start, end - start);
        if (line.empty() || line == "\r") continue;
        answer_request(line, c.may_write, commands_, c.subscription, out_);
        publish(c);
    }
    if (c.dead) return;
    c.input.erase(0, start);
    if (c.input.size() > kLongestLine) {
        log_event(Level::warning, "control", "line", "", "a client sent a line longer than 64 KiB: connection closed");
        close(c);
    }
}

// out_ holds one message.
void ControlServer::publish(Client& c) {
    if (const uint64_t lost = c.queue.lost(); lost > 0) {
        char text[96];
        const int n = snprintf(text, sizeof text, "{\"driveid\":1,\"event\":\"lost\",\"count\":%llu}\n", (unsigned long long)lost);
        if (c.queue.fits(size_t(n) + out_.text().size() + 5)) {
            c.queue.take_lost();
            c.queue.push({text, size_t(n)});
        }
    }
    out_.newline();
    c.queue.push(out_.text());
    flush(c);
}

void ControlServer::flush(Client& c) {
    while (!c.queue.empty()) {
        const std::string_view part = c.queue.front();
        const ssize_t n = ::send(c.fd.get(), part.data(), part.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0 && errno == EAGAIN) break;
        if (n < 0) return close(c);
        c.queue.sent(size_t(n));
    }
    const bool wait = !c.queue.empty();
    if (wait != c.waiting) loop_.modify(c.fd.get(), wait ? EPOLLIN | EPOLLOUT : EPOLLIN);
    c.waiting = wait;
}

void ControlServer::sample(const Drive& drive, const driveid_sample& s) {
    bool made = false;
    for (auto& c : clients_) {
        Subscription& sub = c->subscription;
        if (c->dead || !sub.on || !sub.sample || !sub.wants(drive.config().name) || !sub.due(drive.index())) continue;
        if (!made) out_.clear(), describe_sample(out_, drive, s);
        made = true;
        publish(*c);
    }
}

void ControlServer::report(const Drive& drive) {
    bool made = false;
    for (auto& c : clients_) {
        if (c->dead || !c->subscription.on || !c->subscription.estimate || !c->subscription.wants(drive.config().name)) continue;
        if (!made) out_.clear(), describe_estimate(out_, drive, monotonic_ns());
        made = true;
        publish(*c);
    }
}

void ControlServer::event(const LogEvent& e) {
    JsonOut line(1024);  // an event may arise while out_ is being written
    for (auto& c : clients_) {
        if (c->dead || !c->subscription.on || !c->subscription.event) continue;
        if (line.text().empty()) describe_event(line, e);
        std::swap(line, out_);
        publish(*c);
        std::swap(line, out_);
    }
}

void ControlServer::tick() {
    std::erase_if(clients_, [](auto& c) { return c->dead; });
    bool made = false;
    for (auto& c : clients_) {
        if (!c->subscription.on || !c->subscription.status) continue;
        if (!made) {
            out_.clear();
            out_.open('{').field("driveid", DRIVEID_FORMAT).field("event", "status");
            describe_status(out_, commands_.gateway(), monotonic_ns());
            out_.close('}');
        }
        made = true;
        publish(*c);
    }
}

}  // namespace gw
