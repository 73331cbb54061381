// SPDX-License-Identifier: Apache-2.0
// Everything that one configuration describes: sources, drives, sinks, records, and the way between them.
#pragma once
#include <memory>
#include <vector>

#include "base/json_out.hpp"
#include "base/log.hpp"
#include "config/config.hpp"
#include "drive/drive.hpp"
#include "record/record_writer.hpp"
#include "sink/sink.hpp"
#include "source/replay.hpp"
#include "source/source.hpp"

namespace gw {

// Who wants to know what happens (the control socket).
class Observer {
public:
    virtual void sample(const Drive& drive, const driveid_sample& sample) = 0;
    virtual void report(const Drive& drive) = 0;
protected:
    ~Observer() = default;
};

// Drives of a configuration, built aside: nothing is opened yet. Problems go into errors, in the words of config errors.
std::vector<std::unique_ptr<Drive>> build_drives(const Config& config, DriveListener& listener, std::vector<std::string>& errors);

class Gateway final : public Consumer, public DriveListener {
public:
    // Throws std::runtime_error with all problems, one a line. Opens nothing before start().
    Gateway(Config config, Loop& loop, Observer* observer);
    ~Gateway();

    void start();
    void tick(double elapsed_s);                              // once a second
    bool work() { return player_.work(); }
    bool replay_ended() const { return !player_.empty() && player_.ended(); }

    const Config& config() const { return config_; }
    const std::vector<std::unique_ptr<Source>>& sources() const { return sources_; }
    const std::vector<std::unique_ptr<Drive>>& drives() const { return drives_; }
    std::vector<std::unique_ptr<Drive>>& drives() { return drives_; }
    const std::vector<std::unique_ptr<Sink>>& sinks() const { return sinks_; }
    Drive* drive(const std::string& name) const;

    bool same_as(const Gateway& other) const;                 // its file and its models: nothing to swap
    // Take over drives whose configuration is the same: they keep what they have learnt. Called between construction and start.
    void adopt(Gateway& previous, std::vector<std::string>& changed);

    // "" or what is wrong.
    std::string record_start(const std::string& bare_name);
    RecordWriter* record() const { return record_.get(); }
    // Flushes; bytes is the size of the file.
    void record_stop(uint64_t& bytes);
    void mark(const std::string& text);
    void event(const LogEvent& event);
    // The watchdog's pulse: since the last call messages were taken, or none is waiting to be.
    bool alive();

    Fate on_frame(int source, const canfd_frame& frame, bool fd, const driveid_stamp& stamp) override;
    Fate on_reply(int source, const ModbusReply& reply, const driveid_stamp& stamp) override;
    void on_gap(int source, uint64_t lost) override;
    void on_end(int source) override;
    bool busy() override;
    void on_sample(int drive, const driveid_sample& sample) override;
    void on_report(int drive) override;

private:
    void make_sources();
    void make_sinks();
    void route();
    std::string record_header() const;
    std::string record_layout() const;                        // what the numbers in a record's entries stand for
    std::unique_ptr<RecordWriter> make_record(const std::string& bare_name, std::string& error);
    void record_entry(EntryKind kind, uint16_t source, const driveid_stamp& stamp, const void* payload, size_t size);

    Config config_;
    Loop& loop_;
    Observer* observer_;
    std::vector<std::unique_ptr<Source>> sources_;
    std::vector<std::unique_ptr<Drive>> drives_;
    std::vector<std::unique_ptr<Sink>> sinks_;
    std::vector<std::vector<Drive*>> listeners_;              // by source
    std::unique_ptr<RecordWriter> record_;
    std::string record_name_, record_again_;                  // as it was asked for; what goes on in a file of its own after a reload
    std::vector<RecordWriter*> writers_;                      // of record sinks
    Player player_;
    JsonOut json_;
    uint64_t progress_ = 0, last_progress_ = 0;
};

}  // namespace gw
