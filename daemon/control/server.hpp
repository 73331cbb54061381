// SPDX-License-Identifier: Apache-2.0
// The control socket: JSON lines over a Unix stream socket. docs/manual/control-protocol.md is its page.
#pragma once
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/json_out.hpp"
#include "base/log.hpp"
#include "base/loop.hpp"
#include "config/config.hpp"
#include "control/line_queue.hpp"
#include "gateway.hpp"

namespace gw {

inline constexpr size_t kLongestLine = 65536;

// What the writing commands ask of the daemon.
class Commands {
public:
    virtual Gateway& gateway() = 0;
    virtual std::string reload(std::vector<std::string>& changed) = 0;  // "" or what is wrong
    virtual double uptime_s() const = 0;
protected:
    ~Commands() = default;
};

struct Subscription {
    bool on = false;
    bool estimate = false, sample = false, event = false, status = false;
    std::vector<std::string> drives;     // empty: all
    uint32_t decimate = 1;
    std::vector<uint32_t> phase;         // by drive
    bool wants(const std::string& drive) const;
    bool due(int drive);                 // every decimate-th sample of each drive
};

// One request line -> one answer line. No socket here: fuzzed and tested as it stands.
void answer_request(std::string_view line, bool may_write, Commands& commands, Subscription& subscription, JsonOut& out);

class ControlServer final : public Observer {
public:
    ControlServer(const ControlConfig& config, Loop& loop, Commands& commands);
    ~ControlServer();

    // Throws std::runtime_error with the mend.
    void start();
    void tick();                                              // once a second: status events

    void sample(const Drive& drive, const driveid_sample& sample) override;
    void report(const Drive& drive) override;
    void event(const LogEvent& event);

private:
    struct Client;
    void accept_one();
    void readable(Client& c);
    void flush(Client& c);
    void close(Client& c);
    void publish(Client& c);
    bool may_write(int fd) const;

    ControlConfig config_;
    Loop& loop_;
    Commands& commands_;
    Fd listener_;
    std::vector<std::unique_ptr<Client>> clients_;
    JsonOut out_;
    long write_gid_ = -1;
    bool bound_ = false;
};

}  // namespace gw
