// SPDX-License-Identifier: Apache-2.0
// The running daemon: loop, gateway, control socket, signals, watchdog, state.
#pragma once
#include <memory>
#include <string>

#include "base/loop.hpp"
#include "control/server.hpp"
#include "gateway.hpp"
#include "system/metrics.hpp"

namespace gw {

struct RunOptions {
    bool exit_at_end = false;     // of all replays
};

// Before any thread begins, so that signals reach the loop alone.
void block_signals();

class Daemon final : public Commands {
public:
    Daemon(Config config, RunOptions options);
    ~Daemon();
    int run();                    // exit code

    Gateway& gateway() override { return *gateway_; }
    std::string reload(std::vector<std::string>& changed) override;
    double uptime_s() const override;

private:
    void watch_signals();
    void signalled();
    void tick();
    void save();
    bool idle();
    bool replay_failed() const;   // one cannot be opened, or all together hold no frame

    RunOptions options_;
    Loop loop_;
    ControlServer control_;
    std::unique_ptr<Gateway> gateway_;
    std::unique_ptr<Metrics> metrics_;
    Fd signals_;
    Timer second_, saver_, watchdog_;
    int64_t started_ns_, last_tick_ns_;
    bool ended_ = false;
    int exit_code_ = 0;
};

}  // namespace gw
