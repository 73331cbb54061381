// SPDX-License-Identifier: Apache-2.0
// Replay of records: .drec and candump .log, at their own pace, at a factor, or as fast as possible. Stamps are the recorded
// ones whatever the pace, and all replay sources advance in one order of stamps: the same bits each run.
#pragma once
#include <fstream>
#include <memory>
#include <vector>

#include "base/loop.hpp"
#include "record/candump.hpp"
#include "record/drec.hpp"
#include "source/source.hpp"

namespace gw {

// Next message of one record.
struct Recorded {
    int64_t t_ns = 0;
    driveid_stamp stamp{};
    bool is_frame = true, fd = false;
    canfd_frame frame{};
    ModbusReply reply{};
};

class ReplaySource final : public Source {
public:
    ReplaySource(const SourceConfig& config, int index, Consumer& consumer, std::string path);
    void start() override;
    std::string address() const override { return path_; }

    bool pending() const { return pending_; }
    const Recorded& next() const { return next_; }
    void deliver();            // hands next() over and reads the one after it

private:
    void advance();
    void tell_end();
    bool from_drec();
    bool from_candump();
    bool wanted(uint16_t recorded_source) const;

    std::string path_;
    bool is_drec_;
    DrecReader drec_;
    std::vector<bool> wanted_;
    std::ifstream log_;
    std::string line_;
    std::vector<uint8_t> payload_;
    Recorded next_;
    bool pending_ = false;
};

class Player {
public:
    Player(Loop& loop, Consumer& consumer) : loop_(loop), consumer_(consumer), timer_(loop, [this] { play(); }) {}
    void add(ReplaySource* source) { sources_.push_back(source); }
    void start();              // sources are started
    bool work();               // part of the loop's idle work: true where there is more to do at once
    bool ended() const;
    bool empty() const { return sources_.empty(); }

private:
    void play();
    int64_t due(const ReplaySource& s) const;

    Loop& loop_;
    Consumer& consumer_;
    Timer timer_;
    std::vector<ReplaySource*> sources_;
    int64_t start_mono_ns_ = 0, start_recorded_ns_ = 0;
    bool told_ = false;
};

}  // namespace gw
