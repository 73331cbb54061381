// SPDX-License-Identifier: Apache-2.0
// One drive: messages -> values -> samples -> estimator -> report. No allocation after construction.
#pragma once
#include <array>
#include <memory>
#include <string>
#include <vector>

#include <driveid/estimate.h>
#include <driveid/model.h>
#include <driveid/watch.h>

#include "config/config.hpp"
#include "drive/align.hpp"
#include "drive/field.hpp"
#include "drive/pace.hpp"
#include "drive/shift.hpp"
#include "source/source.hpp"

namespace gw {

enum class DriveState { waiting, identifying, valid, frozen, stale, error };
const char* drive_state_name(DriveState state);

struct ParameterReport {
    char name[DRIVEID_NAME_SIZE] = "";
    char unit[16] = "";
    bool known = false;          // a trusted estimate existed, or was restored
    bool trusted = false;        // by the newest estimate
    double value = 0, lo = 0, hi = 0;
    int64_t t_ns = 0;            // of the estimate
    double restored_age_s = -1;  // >= 0: comes from before the restart, this old at start
};

struct DriveCounters {
    uint64_t gaps = 0, dropped = 0, rejected = 0, duplicates = 0, reordered = 0, jumps = 0, saturations = 0;
};

// What the drive tells its listener while messages are fed.
class DriveListener {
public:
    virtual void on_sample(int drive, const driveid_sample& sample) = 0;
    virtual void on_report(int drive) = 0;
protected:
    ~DriveListener() = default;
};

class Drive {
public:
    // Throws std::runtime_error with a sentence and its mend where model, structure and signals do not fit.
    Drive(const DriveConfig& config, const Config& all, int index, DriveListener& listener);

    Fate frame(int source, const canfd_frame& frame, bool extended, const driveid_stamp& stamp);
    Fate reply(int source, const ModbusReply& reply, const driveid_stamp& stamp);
    void gap(int source, uint64_t lost);
    void restart();
    bool uses(int source) const;
    // What the estimator knew before the restart: kept and saved again until it knows more; never an answer.
    void remember(const double* theta, const double* covariance, uint32_t params);

    // Reload: same model file content and the like; then everything learnt is taken over.
    bool same_model(const Drive& other) const;
    void take(const Drive& other);

    // now_ns: monotonic; for records the time of the last sample stands for it.
    DriveState state(int64_t now_ns) const;
    bool valid(const ParameterReport& p, int64_t now_ns) const;
    double age_s(const ParameterReport& p, int64_t now_ns) const;

    const DriveConfig& config() const { return config_; }
    const std::string& model_text() const { return model_text_; }  // of the model file, "" where there is none
    const driveid_online& online() const { return online_; }
    const std::vector<ParameterReport>& parameters() const { return parameters_; }
    std::vector<ParameterReport>& parameters() { return parameters_; }
    const driveid_estimate& estimate() const { return estimate_; }
    DriveCounters counters() const;
    uint64_t samples() const { return aligner_.counters().samples; }
    driveid_status status() const { return status_; }
    int64_t last_ns() const { return last_ns_; }
    double rate_Hz() const { return mean_dt_s_ > 0 ? 1.0 / mean_dt_s_ : 0; }
    double jitter_ns() const { return jitter_ns_; }
    double first_trusted_s() const { return first_trusted_s_; }
    int64_t alarm_since_ns() const { return alarm_since_ns_; }
    uint32_t restarts() const { return restarts_before_ + estimate_.restarts; }
    bool alarm() const { return alarm_; }
    int index() const { return index_; }
    const char* residual_unit() const;
    double residual_rms() const;
    // What the loaded model says of the drive; null where nothing watches.
    const driveid_watch_report* watch() const { return watch_.empty() ? nullptr : driveid_watch_answer(watcher()); }
    const char* structure() const { return has_no_model() ? "sinusoids" : driveid_structure_name(online_.model.structure); }
    bool has_no_model() const { return config_.method == "frequency"; }

private:
    struct CanSignal { int source; driveid_signal signal; CanField field; Scaler scaler; int64_t delay_ns; };
    struct RegisterSignal { int source; driveid_signal signal; RegisterField field; Scaler scaler; uint8_t unit; };

    void load_model(const Config& all);
    void make_signals(const Config& all);
    void make_online(uint32_t present);
    void make_estimator(uint32_t present);
    void make_shifter(const Config& all, uint32_t waited);
    void values(uint32_t mask, const double* value, const driveid_stamp& stamp);
    void tell_incomplete();
    void tear(unsigned gaps);
    bool holds_what_was(int64_t since_ns) const;
    void follow_saturation(int64_t t_ns);
    bool counter_says_skip(uint64_t now, unsigned bits, bool each);
    void sample(const driveid_sample& sample);
    void timing(int64_t t_ns);
    void report();
    void forget_alarm();
    void residual_alarm(const driveid_estimate& e);
    void declare_ranges(double* channel_range) const;
    void make_watch();
    void follow_watch();
    driveid_estimator* estimator() { return reinterpret_cast<driveid_estimator*>(estimator_.data()); }
    driveid_watch* watcher() { return reinterpret_cast<driveid_watch*>(watch_.data()); }
    const driveid_watch* watcher() const { return reinterpret_cast<const driveid_watch*>(watch_.data()); }
    const driveid_estimator* estimator() const { return reinterpret_cast<const driveid_estimator*>(estimator_.data()); }

    DriveConfig config_;
    int index_;
    DriveListener& listener_;
    std::string model_text_;
    driveid_model model_{};
    driveid_online online_{}, fresh_online_{};   // fresh: as configured, without memory of samples
    std::vector<std::max_align_t> estimator_, watch_;
    driveid_estimate estimate_{};
    driveid_status status_ = DRIVEID_NOT_YET;
    std::vector<ParameterReport> parameters_;
    std::vector<CanSignal> can_;
    std::vector<RegisterSignal> registers_;
    std::array<bool, DRIVEID_SIGNAL_COUNT> wait_{};
    std::unique_ptr<CanField> counter_;
    std::unique_ptr<RegisterField> counter_register_;
    unsigned counter_unit_ = 0;
    int counter_source_ = -1;
    bool counter_primed_ = false;
    uint64_t last_counter_ = 0, counted_ = 1;  // counted: what the counter went on by
    int64_t instant_ns_ = 0;         // stamp of the last frame that marks the sampling instant
    Aligner aligner_;
    Pacer pacer_;
    Shifter shifter_;
    bool torn_ = false;              // the time line was torn at the last sample
    uint64_t incomplete_told_ = 0, samples_told_ = 0;
    uint32_t saturations_ = 0;       // q31: values beyond their range, as the estimator counts them
    uint64_t samples_seen_ = 0;      // at the last report
    int64_t saturated_until_ns_ = 0; // and how long they are remembered
    DriveCounters counters_;
    bool replayed_ = false;
    int64_t first_ns_ = 0, last_ns_ = 0, next_report_ns_ = 0, first_after_restart_ns_ = 0;
    double mean_dt_s_ = 0, jitter_ns_ = 0, first_trusted_s_ = -1;
    uint32_t restarts_seen_ = 0, restarts_before_ = 0;   // of the estimator, before it was last begun anew
    bool gap_told_ = false;          // this one is counted
    bool restarted_ = false, alarm_ = false, resting_ = false, was_resting_ = false;
    bool withheld_ = false;   // the model lacks an effect: its parameters are not trusted
    int64_t alarm_since_ns_ = 0;
    const char* likely_ = nullptr;   // effect of the last announcement
    double channel_[DRIVEID_CHANNELS_MAX]{};
};

}  // namespace gw
