// SPDX-License-Identifier: Apache-2.0
#include "drive/drive.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/log.hpp"

namespace gw {

namespace {
constexpr double kSaturated = 0.05;                      // of the samples
constexpr uint64_t kIncompleteTold = 200;                // sets of values
constexpr double kMemory_s = 10;                         // of the estimator, where the configuration leaves it
constexpr int64_t kChangeNs = 2 * DRIVEID_NS_PER_S;     // a residual alarm and the watch see one change within this
constexpr int64_t kAlarmHoldNs = 30 * DRIVEID_NS_PER_S;  // a restart is a mismatch for this long in the drive's time
}

const char* drive_state_name(DriveState state) {
    static const char* const names[] = {"waiting", "identifying", "valid", "frozen", "stale", "error"};
    return names[int(state)];
}

bool Drive::same_model(const Drive& o) const {
    const auto same_params = [](const driveid_param* a, const driveid_param* b, uint32_t n) {
        for (uint32_t k = 0; k < n; ++k)
            if (strcmp(a[k].name, b[k].name) || a[k].state != b[k].state || a[k].value != b[k].value) return false;
        return true;
    };
    const driveid_model &a = model_, &b = o.model_;
    if (a.structure != b.structure || a.params != b.params || a.effects != b.effects || !same_params(a.param, b.param, a.params)) return false;
    for (uint32_t e = 0; e < a.effects; ++e) {
        const driveid_effect_use &x = a.effect[e], &y = b.effect[e];
        if (strcmp(x.name, y.name) || strcmp(x.formula, y.formula) || x.params != y.params || !same_params(x.param, y.param, x.params)) return false;
    }
    return estimator_.size() == o.estimator_.size();
}

void Drive::take(const Drive& o) {
    online_ = o.online_;
    estimator_ = o.estimator_;
    watch_ = o.watch_;
    estimate_ = o.estimate_;
    status_ = o.status_;
    parameters_ = o.parameters_;
    saturations_ = o.saturations_, saturated_until_ns_ = o.saturated_until_ns_;
    for (size_t k = 0; k < can_.size(); ++k) can_[k].scaler = o.can_[k].scaler;
    for (size_t k = 0; k < registers_.size(); ++k) registers_[k].scaler = o.registers_[k].scaler;
    counter_primed_ = o.counter_primed_, last_counter_ = o.last_counter_, instant_ns_ = o.instant_ns_;
    aligner_ = o.aligner_;
    pacer_ = o.pacer_;
    shifter_ = o.shifter_;
    counters_ = o.counters_;
    first_ns_ = o.first_ns_, last_ns_ = o.last_ns_, next_report_ns_ = o.next_report_ns_, first_after_restart_ns_ = o.first_after_restart_ns_;
    mean_dt_s_ = o.mean_dt_s_, jitter_ns_ = o.jitter_ns_, first_trusted_s_ = o.first_trusted_s_;
    restarts_before_ = o.restarts_before_, restarts_seen_ = o.restarts_seen_, restarted_ = o.restarted_, alarm_ = o.alarm_, alarm_since_ns_ = o.alarm_since_ns_, likely_ = o.likely_, withheld_ = o.withheld_;
}

// With a watch the residual is that of the loaded model's torque or force balance, else the estimator's first equation.
const char* Drive::residual_unit() const {
    if (has_no_model()) return online_.physical_unit[1];
    if (watch() && watch()->ready) return driveid_dimension_unit(DRIVEID_DIM_FORCE, driveid_model_frame(&online_.model), 'A');
    switch (online_.model.structure) {
        case DRIVEID_STRUCTURE_LINEAR_AXIS: return "N";
        case DRIVEID_STRUCTURE_DC_CIRCUIT:
        case DRIVEID_STRUCTURE_DC_DRIVE:
        case DRIVEID_STRUCTURE_PMSM_DRIVE: return "V";
        case DRIVEID_STRUCTURE_LTI: return "";
        default: return "N m";
    }
}

double Drive::residual_rms() const { return watch() && watch()->ready ? watch()->rms : estimate_.residual_rms; }

bool Drive::uses(int source) const {
    return std::any_of(can_.begin(), can_.end(), [&](auto& s) { return s.source == source; }) ||
           std::any_of(registers_.begin(), registers_.end(), [&](auto& s) { return s.source == source; });
}

// One frame may carry several signals: either all of them are read, or the frame is rejected and changes nothing.
Fate Drive::frame(int source, const canfd_frame& f, bool extended, const driveid_stamp& stamp) {
    const uint32_t id = f.can_id & (extended ? CAN_EFF_MASK : CAN_SFF_MASK);
    bool mine = false;
    if (config_.instant_can_id >= 0 && !extended && id == uint32_t(config_.instant_can_id)) {
        instant_ns_ = stamp.t_ns;
        mine = true;
    }
    for (const auto& s : can_) {
        if (s.source != source || !s.field.matches(id, extended)) continue;
        if (f.len < s.field.bytes() || f.can_id & CAN_RTR_FLAG) return ++counters_.rejected, Fate::rejected;
        mine = true;
    }
    if (!mine) return Fate::unused;
    if (counter_ && counter_source_ == source && counter_->matches(id, extended)) {
        if (f.len < counter_->bytes()) return ++counters_.rejected, Fate::rejected;
        if (counter_says_skip(counter_->bits.extract(f.data), counter_->bits.length, true)) return Fate::used;
    }
    driveid_stamp when = stamp;
    if (config_.instant_can_id >= 0 && instant_ns_ > 0 && stamp.t_ns - instant_ns_ < int64_t(config_.dt_s * 1e9)) when.t_ns = std::min(instant_ns_, stamp.t_ns);
    uint32_t mask = 0;
    double value[DRIVEID_SIGNAL_COUNT];
    bool jump = false;
    for (auto& s : can_) {
        if (s.source != source || !s.field.matches(id, extended)) continue;
        if (s.field.has_mux && s.field.mux.extract(f.data) != s.field.mux_value) continue;
        const auto r = s.scaler.convert(s.field.bits.extract(f.data), when.t_ns, value[s.signal]);
        if (r == Scaler::Result::out_of_range) return ++counters_.rejected, Fate::rejected;
        jump |= r == Scaler::Result::jump;
        mask |= 1u << s.signal;
        if (s.delay_ns) {  // a value of its own age is handed over with its own stamp
            driveid_stamp early = when;
            early.t_ns -= s.delay_ns;
            values(1u << s.signal, value, early);
            mask &= ~(1u << s.signal);
        }
    }
    if (jump) {
        ++counters_.jumps;
        log_event(Level::warning, config_.name.c_str(), "jump", "", "a value jumped faster than max_rate: an encoder was reset or the payload is corrupt");
        gap(source, 0);
    }
    if (mask) values(mask, value, when);
    return Fate::used;
}

// The reply has all registers of the field.
static bool holds(const ModbusReply& r, const RegisterField& f) {
    return r.function == (f.holding ? 3 : 4) && f.address >= r.address && f.address + f.count <= r.address + r.count;
}

Fate Drive::reply(int source, const ModbusReply& r, const driveid_stamp& stamp) {
    uint32_t mask = 0;
    double value[DRIVEID_SIGNAL_COUNT];
    bool jump = false;
    if (counter_register_ && counter_source_ == source && counter_unit_ == r.unit && holds(r, *counter_register_) &&
        counter_says_skip(counter_register_->extract(r.registers + (counter_register_->address - r.address)), counter_register_->count * 16u, false))
        return Fate::used;
    for (auto& s : registers_) {
        if (s.source != source || s.unit != r.unit || !holds(r, s.field)) continue;
        const auto result = s.scaler.convert(s.field.extract(r.registers + (s.field.address - r.address)), stamp.t_ns, value[s.signal]);
        if (result == Scaler::Result::out_of_range) return ++counters_.rejected, Fate::rejected;
        jump |= result == Scaler::Result::jump;
        mask |= 1u << s.signal;
    }
    if (!mask) return Fate::unused;
    if (jump) {
        ++counters_.jumps;
        gap(source, 0);
    }
    values(mask, value, stamp);
    return Fate::used;
}

// The message's own counter tells loss, repetition and reordering apart. each: every count is sent; a poll sees only some of them.
bool Drive::counter_says_skip(uint64_t now, unsigned bits, bool each) {
    const uint64_t range = bits >= 64 ? 0 : uint64_t(1) << bits;
    const uint64_t step = range ? (now - last_counter_) & (range - 1) : now - last_counter_;
    const bool first = !counter_primed_;
    if (!first && step == 0) return ++counters_.duplicates, true;
    if (!first && range && step > range / 2) return ++counters_.reordered, true;
    counter_primed_ = true;
    last_counter_ = now;
    counted_ = first ? 1 : step;
    if (!first && each && step > 1) {
        counters_.dropped += step - 1;
        log_event(Level::warning, config_.name.c_str(), "lost", "", "%llu messages lost by their own counter", (unsigned long long)(step - 1));
    }
    return false;
}

void Drive::values(uint32_t mask, const double* value, const driveid_stamp& stamp) {
    driveid_sample s;
    if (!aligner_.add(mask, value, stamp, s)) return tell_incomplete();
    if (config_.paced) s.stamp.t_ns = pacer_.instant(s.stamp.t_ns, config_.has_counter ? counted_ : 0);
    const bool torn = config_.paced && pacer_.torn();
    if (torn) tear(torn_ ? 0 : 1);
    torn_ = torn;
    shifter_.add(s, [this](const driveid_sample& shifted) { sample(shifted); });
}

// Values that never come together are no loss of the bus: nothing else would say why there are no samples.
void Drive::tell_incomplete() {
    const AlignCounters& n = aligner_.counters();
    if (n.incomplete - incomplete_told_ < kIncompleteTold) return;
    const bool most = n.incomplete - incomplete_told_ > n.samples - samples_told_;
    incomplete_told_ = n.incomplete, samples_told_ = n.samples;
    if (most)
        log_event(Level::warning, config_.name.c_str(), "align", "raise align_tolerance_s, or say with the signals' delay_s how old they are",
                  "most values are thrown away: those of one sample arrive further apart than align_tolerance_s, %g s, or one of them is missing", config_.align_tolerance_s);
}

void Drive::gap(int source, uint64_t lost) {
    if (!uses(source)) return;
    counters_.dropped += lost;
    tear(1);
    aligner_.restart();
    pacer_.restart();
}

// Between the last sample and the next one lies an unknown time. gaps: 0 where it belongs to one that is counted.
void Drive::tear(unsigned gaps) {
    counters_.gaps += gaps;
    gap_told_ = true;
    driveid_estimator_gap(estimator());
    driveid_online_gap(&online_);
    if (!watch_.empty()) driveid_watch_gap(watcher());
    shifter_.restart();
}

// What was said of the drive so far is no longer said: the watch begins anew too.
void Drive::forget_alarm() {
    make_watch();
    alarm_ = withheld_ = restarted_ = false;
    likely_ = nullptr;
}

void Drive::restart() {
    driveid_estimator_restart(estimator());
    online_ = fresh_online_;
    forget_alarm();
    for (auto& s : can_) s.scaler.forget();
    for (auto& s : registers_) s.scaler.forget();
    aligner_.restart();
    pacer_.restart();
    shifter_.restart();
    status_ = DRIVEID_NOT_YET;
    for (auto& p : parameters_) p.trusted = false;
}

void Drive::remember(const double* theta, const double* covariance, uint32_t params) {
    if (params != online_.physical || estimate_.params != 0) return;
    estimate_.params = params;
    std::copy_n(theta, params, estimate_.theta);
    std::copy_n(covariance, params * params, estimate_.cov);
}

// Slow means over about 100 samples: the first sample after a gap is no jitter.
void Drive::timing(int64_t t_ns) {
    const double dt = double(t_ns - last_ns_) * 1e-9;
    const double longest = config_.gap_s > 0 ? config_.gap_s : 5 * config_.dt_s;
    if (samples() < 2 || dt > longest) return;
    mean_dt_s_ += (mean_dt_s_ == 0 ? 1.0 : 0.01) * (dt - mean_dt_s_);
    const double deviation = (dt - mean_dt_s_) * 1e9;
    jitter_ns_ = std::sqrt(jitter_ns_ * jitter_ns_ * 0.99 + 0.01 * deviation * deviation);
}

void Drive::sample(const driveid_sample& s) {
    if (samples() == 1 || first_ns_ == 0) first_ns_ = s.stamp.t_ns;
    if (aligner_.new_time_line()) {
        log_event(Level::warning, config_.name.c_str(), "time-line", "", "stamps went back for good: a new time line begins");
        driveid_estimator_restart(estimator());
        online_ = fresh_online_;
        forget_alarm();
        first_ns_ = next_report_ns_ = s.stamp.t_ns;
        mean_dt_s_ = jitter_ns_ = 0;
    } else {
        timing(s.stamp.t_ns);
    }
    last_ns_ = s.stamp.t_ns;
    listener_.on_sample(index_, s);
    if (!watch_.empty()) driveid_watch_sample(watcher(), &s);
    const driveid_status filled = driveid_online_channels(&online_, &s, channel_);
    resting_ = filled == DRIVEID_FROZEN;  // the silence that the estimator then sees is no gap of the data
    if (filled == DRIVEID_ERR_VALUE) ++counters_.rejected;
    if (filled == DRIVEID_OK) {
        const driveid_status updated = driveid_estimator_update(estimator(), online_.t_ns, channel_);
        if (updated == DRIVEID_GAP && !was_resting_ && !gap_told_) ++counters_.gaps;
        gap_told_ = false;
        if (updated == DRIVEID_ERR_VALUE) ++counters_.rejected;
        was_resting_ = false;
    }
    was_resting_ |= resting_;
    if (s.stamp.t_ns < next_report_ns_) return;
    next_report_ns_ = s.stamp.t_ns + int64_t(config_.report_s * 1e9);
    report();
}

// NOT_YET after a restart takes the trust away: the held values are from before the change.
void Drive::report() {
    driveid_estimate e;
    const driveid_status status = driveid_estimator_estimate(estimator(), &e);
    const bool written = status == DRIVEID_OK || status == DRIVEID_WEAK_EXCITATION || status == DRIVEID_RANK || status == DRIVEID_FROZEN;
    status_ = resting_ && status >= 0 ? DRIVEID_FROZEN : status;
    if (written && !watch_.empty()) driveid_watch_estimate(watcher(), &e, status);
    if (!written) {
        for (auto& p : parameters_) p.trusted = false;
    } else {
        estimate_ = e;
        residual_alarm(e);
        driveid_param physical[DRIVEID_THETA_MAX];
        uint32_t valid_mask = 0;
        if (driveid_online_physical(&online_, &e, physical, &valid_mask) == DRIVEID_OK) {
            for (size_t k = 0; k < parameters_.size(); ++k) {
                ParameterReport& p = parameters_[k];
                p.trusted = valid_mask >> k & 1u;
                if (!p.trusted) continue;
                p.known = true;
                p.value = physical[k].value, p.lo = physical[k].lo, p.hi = physical[k].hi;
                p.t_ns = e.t_ns;
                p.restored_age_s = -1;
            }
            const bool all = std::all_of(parameters_.begin(), parameters_.end(), [](auto& p) { return p.trusted; });
            if (all && !withheld_ && first_trusted_s_ < 0) first_trusted_s_ = double(e.t_ns - first_ns_) * 1e-9;
        }
    }
    follow_saturation(last_ns_);
    follow_watch();
    listener_.on_report(index_);
}

void Drive::residual_alarm(const driveid_estimate& e) {
    if (e.restarts > restarts_seen_) {
        log_event(Level::warning, config_.name.c_str(), "residual", has_no_model() ? "" : "explain the record: driveid explain",
                  has_no_model() ? "the signal left its frequencies: they are looked for anew" : "the residual left its level: the drive changed, or the model lacks an effect");
        if (!alarm_) alarm_since_ns_ = e.t_ns;
        restarted_ = true;
        first_after_restart_ns_ = e.t_ns;
    } else if (restarted_ && e.t_ns - first_after_restart_ns_ > kAlarmHoldNs) {
        restarted_ = false;
    }
    restarts_seen_ = e.restarts;
}

// Fixed point clips what is beyond its range: where that is often, the parameters are bent for as long as it is remembered.
void Drive::follow_saturation(int64_t t_ns) {
    const uint32_t saturations = driveid_estimator_saturations(estimator());
    if (saturations < saturations_) saturations_ = 0;  // it has begun anew
    counters_.saturations += saturations - saturations_;
    if (double(saturations - saturations_) > kSaturated * double(samples() - samples_seen_)) {
        log_event(Level::warning, config_.name.c_str(), "saturation", "raise `range` of the signals, or `speed_range`", "values beyond their declared range");
        saturated_until_ns_ = t_ns + int64_t((config_.forgetting_s > 0 ? std::min(config_.forgetting_s, 3600.0) : kMemory_s) * 1e9);
    }
    saturations_ = saturations;
    samples_seen_ = samples();
    if (t_ns < saturated_until_ns_)
        for (auto& p : parameters_) p.trusted = false;
}

// What the estimator follows with the model that it has; any other effect bends its parameters.
static bool is_change_of_parameter(const char* effect) { return std::strcmp(effect, "inertia_change") == 0 || std::strcmp(effect, "friction_drift") == 0; }

// The sums know the drive from before since_ns: they had an answer then, and have not begun anew with the change already. A user who wants no restarts gets none.
bool Drive::holds_what_was(int64_t since_ns) const {
    const bool anew = restarted_ && first_after_restart_ns_ + kChangeNs > since_ns;
    return config_.alarm >= 0 && !anew && estimate_.first_trusted_ns > 0 && estimate_.first_trusted_ns < since_ns;
}

// One alarm: the loaded model does not explain the drive, or, where nothing watches yet, the estimator has restarted not long ago.
void Drive::follow_watch() {
    const driveid_watch_report* w = watch();
    const bool mismatch = w && w->mismatch;
    alarm_ = mismatch || (restarted_ && !(w && w->ready));
    if (mismatch) alarm_since_ns_ = w->since_ns;
    const char* effect = mismatch ? w->effect : nullptr;
    withheld_ = mismatch && !is_change_of_parameter(effect);
    if (effect && effect != likely_)
        log_event(Level::warning, config_.name.c_str(), "model", "explain a record of it: driveid explain",
                  "the model no longer explains this drive; likely effect: %s; most of it %s", effect, driveid_watch_regime_name(w->regime));
    // The sums still hold the drive as it was: mixed with what it is now they give values that are neither, for as long as they remember.
    if (effect && effect != likely_ && is_change_of_parameter(effect) && holds_what_was(w->since_ns)) {
        driveid_estimator_restart(estimator());
        restarts_before_ += estimate_.restarts + 1;
        restarts_seen_ = estimate_.restarts = 0;
        for (auto& p : parameters_) p.trusted = false;
    }
    if (!mismatch && likely_) log_event(Level::info, config_.name.c_str(), "model", "", "the model explains this drive again");
    likely_ = effect;
}

DriveState Drive::state(int64_t now_ns) const {
    if (status_ < 0) return DriveState::error;
    if (samples() == 0) return DriveState::waiting;
    const bool silent = !replayed_ && double(now_ns - last_ns_) * 1e-9 > config_.stale_s;
    if (silent) return DriveState::stale;
    if (status_ == DRIVEID_FROZEN) return DriveState::frozen;
    const bool trusted = !withheld_ && std::any_of(parameters_.begin(), parameters_.end(), [](auto& p) { return p.trusted; });
    return trusted ? DriveState::valid : DriveState::identifying;
}

bool Drive::valid(const ParameterReport& p, int64_t now_ns) const {
    if (!p.known || !p.trusted || withheld_) return false;
    const DriveState s = state(now_ns);
    return s == DriveState::valid || s == DriveState::frozen;
}

double Drive::age_s(const ParameterReport& p, int64_t now_ns) const {
    const int64_t now = replayed_ ? last_ns_ : now_ns;
    return p.restored_age_s >= 0 ? p.restored_age_s + double(now_ns - p.t_ns) * 1e-9 : std::max(0.0, double(now - p.t_ns) * 1e-9); // a replay may have begun again
}

DriveCounters Drive::counters() const {
    DriveCounters c = counters_;
    c.dropped += aligner_.counters().incomplete + shifter_.lost();
    c.duplicates += aligner_.counters().duplicates;
    c.reordered += aligner_.counters().late;
    return c;
}

}  // namespace gw
