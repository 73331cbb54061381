// SPDX-License-Identifier: Apache-2.0
#include "daemon.hpp"

#include <arpa/inet.h>
#include <cerrno>
#include <csignal>
#include <stdexcept>
#include <sys/epoll.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <driveid/version.h>

#include "base/clock.hpp"
#include "system/notify.hpp"
#include "system/sandbox.hpp"
#include "system/state.hpp"

namespace gw {

namespace {
constexpr int kReplayFailed = 2;

sigset_t watched_signals() {
    sigset_t set;
    sigemptyset(&set);
    for (int s : {SIGTERM, SIGINT, SIGHUP}) sigaddset(&set, s);
    return set;
}

// Once the daemon has become another user, a privileged port that it closed is lost.
std::string ports_out_of_reach(const Config& config) {
    for (const auto& s : config.sinks) {
        if (s.kind != "modbus_server" || s.port >= 1024) continue;
        const Fd probe(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
        sockaddr_in at{};
        at.sin_family = AF_INET;
        at.sin_port = htons(uint16_t(s.port));
        inet_pton(AF_INET, s.host.c_str(), &at.sin_addr);
        if (bind(probe.get(), reinterpret_cast<sockaddr*>(&at), sizeof at) != 0 && errno == EACCES)
            return config.file + ":" + std::to_string(s.place.line) + ": sink \"" + s.name + "\".port: " + std::to_string(s.port) +
                   " takes privileges that are gone since the start; restart the daemon, or choose a port above 1023";
    }
    return "";
}
}  // namespace

Daemon::Daemon(Config config, RunOptions options)
    : options_(options), control_(config.control, loop_, *this), gateway_(std::make_unique<Gateway>(std::move(config), loop_, &control_)),
      second_(loop_, [this] { tick(); }), saver_(loop_, [this] { save(); }), watchdog_(loop_, [this] { if (gateway_->alive()) notify("WATCHDOG=1"); }),
      started_ns_(monotonic_ns()), last_tick_ns_(started_ns_) {
    log_listen([](void* self, const LogEvent& e) {
        auto* d = static_cast<Daemon*>(self);
        d->control_.event(e);
        if (d->gateway_) d->gateway_->event(e);
    }, this);
}

Daemon::~Daemon() { log_listen(nullptr, nullptr); }

double Daemon::uptime_s() const { return double(monotonic_ns() - started_ns_) * 1e-9; }

void block_signals() {
    const sigset_t set = watched_signals();
    sigprocmask(SIG_BLOCK, &set, nullptr);
    signal(SIGPIPE, SIG_IGN);
}

void Daemon::watch_signals() {
    const sigset_t set = watched_signals();
    signals_.reset(signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC));
    loop_.add(signals_.get(), EPOLLIN, [this](uint32_t) { signalled(); });
}

void Daemon::signalled() {
    signalfd_siginfo info;
    while (read(signals_.get(), &info, sizeof info) == sizeof info) {
        if (info.ssi_signo != SIGHUP) {
            log_event(Level::info, "daemon", "stop", "", "stopped by signal %u", info.ssi_signo);
            loop_.stop();
            return;
        }
        std::vector<std::string> changed;
        notify("RELOADING=1");
        const std::string error = reload(changed);
        if (!error.empty()) log_event(Level::error, "daemon", "reload", "mend the file; the old configuration stays", "%s", error.c_str());
        else log_event(Level::info, "daemon", "reloaded", "", "configuration reloaded, %zu changes", changed.size());
        notify("READY=1");
    }
}

// Everything is built aside; only a whole new gateway takes the old one's place.
std::string Daemon::reload(std::vector<std::string>& changed) {
    ConfigResult result = config_read_file(gateway_->config().file);
    std::string errors;
    for (const auto& e : result.errors) errors += (errors.empty() ? "" : "\n") + e;
    if (!errors.empty()) return errors;
    try {
        auto fresh = std::make_unique<Gateway>(std::move(result.config), loop_, &control_);
        if (fresh->same_as(*gateway_)) return "";
        const std::string lost = ports_out_of_reach(fresh->config());
        if (!lost.empty()) return lost;
        fresh->adopt(*gateway_, changed);
        gateway_ = nullptr;  // closes ports and interfaces before they are opened anew
        gateway_ = std::move(fresh);
        gateway_->start();
    } catch (const std::exception& e) {
        return e.what();
    }
    return "";
}

void Daemon::tick() {
    const int64_t now = monotonic_ns();
    gateway_->tick(double(now - last_tick_ns_) * 1e-9);
    last_tick_ns_ = now;
    control_.tick();
}

void Daemon::save() {
    const std::string& folder = gateway_->config().state.folder;
    if (folder.empty()) return;
    const std::string error = state_save(config_path(gateway_->config(), folder), gateway_->drives());
    if (!error.empty()) log_event(Level::error, "state", "save", "make room or mend [state] folder; it is tried again", "%s", error.c_str());
}

bool Daemon::idle() {
    const bool more = gateway_->work();
    if (!ended_ && gateway_->replay_ended()) {
        ended_ = true;
        if (options_.exit_at_end) {
            exit_code_ = replay_failed() ? kReplayFailed : 0;
            loop_.stop();
        }
    }
    return more;
}

bool Daemon::replay_failed() const {
    bool any = false;
    for (auto& s : gateway_->sources()) {
        if (s->config().kind != "replay") continue;
        if (s->status().state == "closed") return true;
        any |= s->status().frames > 0;
    }
    return !any;
}

int Daemon::run() {
    const Config& c = gateway_->config();
    watch_signals();
    set_scheduling(c.system);
    control_.start();
    if (!c.system.metrics.empty()) metrics_ = std::make_unique<Metrics>(c.system.metrics, loop_, *this);
    if (!c.state.folder.empty()) {
        const std::string restored = state_restore(config_path(c, c.state.folder), gateway_->drives());
        if (!restored.empty()) log_event(Level::info, "state", "restored", "", "%s", restored.c_str());
        saver_.start(int64_t(c.state.period_s * 1e9), int64_t(c.state.period_s * 1e9));
    }
    gateway_->start();
    drop_privileges(c.security.user);
    restrict_system_calls(c.security.seccomp);
    second_.start(1000000000, 1000000000);
    if (const int64_t period = watchdog_period_ns(); period > 0) watchdog_.start(period, period);
    notify("READY=1");
    log_event(Level::info, "daemon", "ready", "", "driveidd %s ready: %zu sources, %zu drives, %zu sinks", DRIVEID_VERSION, gateway_->sources().size(),
              gateway_->drives().size(), gateway_->sinks().size());
    loop_.idle([this] { return idle(); });
    loop_.run();
    notify("STOPPING=1");
    save();
    return exit_code_;
}

}  // namespace gw
