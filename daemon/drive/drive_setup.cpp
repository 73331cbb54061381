// SPDX-License-Identifier: Apache-2.0
// Building a drive from its configuration: model, signals, estimator.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include <driveid/frequency.h>
#include <driveid/fsm.h>
#include <driveid/model_file.h>

#include "drive/drive.hpp"

namespace gw {

namespace {

constexpr uintmax_t kLongestModel = 1 << 20;

int source_index(const std::vector<SourceConfig>& sources, const std::string& name) {
    for (size_t k = 0; k < sources.size(); ++k)
        if (sources[k].name == name) return int(k);
    return -1;
}

std::string where(const Config& all, const DriveConfig& drive) {
    return all.file + ":" + std::to_string(drive.place.line) + ": drive \"" + drive.name + "\": ";
}

const char* clean(const char* reason, driveid_status status) { return *reason ? reason : driveid_status_text(status); }

// Pole that frequency shifting is offered for a motion of this band; every method's filters take it as their bandwidth.
double suggested(const DriveConfig& drive) {
    char reason[200] = "";
    driveid_fsm_config filters{};
    filters.order = 2;
    if (driveid_fsm_suggest(&filters, drive.dt_s, drive.motion_rad_s, 0, reason, sizeof reason) != DRIVEID_OK) throw std::runtime_error(std::string("motion_rad_s: ") + reason);
    return filters.pole_rad_s[0];
}

}  // namespace

Drive::Drive(const DriveConfig& config, const Config& all, int index, DriveListener& listener) : config_(config), index_(index), listener_(listener) {
    if (!has_no_model()) load_model(all);
    make_signals(all);
}

void Drive::load_model(const Config& all) {
    char reason[512] = "";
    if (!config_.model.empty()) {
        const std::string path = config_path(all, config_.model);
        std::error_code ec;
        if (!std::filesystem::is_regular_file(path, ec) || std::filesystem::file_size(path, ec) > kLongestModel)
            throw std::runtime_error(where(all, config_) + "model " + path + (std::filesystem::exists(path, ec) ? " is no model file: a text of at most 1 MiB" : " cannot be read; check its name and permissions"));
        std::ifstream file(path, std::ios::binary);
        std::stringstream text;
        text << file.rdbuf();
        if (!file) throw std::runtime_error(where(all, config_) + "model " + path + " cannot be read; check its name and permissions");
        model_text_ = text.str();
        const driveid_status s = driveid_model_read(model_text_.c_str(), &model_, reason, sizeof reason);
        if (s != DRIVEID_OK) throw std::runtime_error(where(all, config_) + "model " + path + ": " + clean(reason, s));
    } else {
        driveid_structure structure;
        if (driveid_structure_from_name(config_.structure.c_str(), &structure) != DRIVEID_OK || driveid_model_init(&model_, structure) != DRIVEID_OK)
            throw std::runtime_error(where(all, config_) + "unknown structure \"" + config_.structure + "\"");
    }
    for (const auto& [name, value] : config_.given)
        if (driveid_model_give(&model_, name.c_str(), value) != DRIVEID_OK)
            throw std::runtime_error(where(all, config_) + "given." + name + ": structure " + driveid_structure_name(model_.structure) + " has no such parameter, or the value is out of range");
    for (const auto& effect : config_.effects) {
        const driveid_status s = driveid_model_add(&model_, effect.c_str(), nullptr, nullptr, reason, sizeof reason);
        if (s != DRIVEID_OK) throw std::runtime_error(where(all, config_) + "effect " + effect + ": " + clean(reason, s));
    }
}

void Drive::make_signals(const Config& all) {
    AlignOptions align;
    uint32_t present = 0;
    for (const SignalConfig& c : config_.signals) {
        driveid_signal signal;
        driveid_signal_from_name(c.name.c_str(), &signal);
        const int source = source_index(all.sources, c.source);
        const SourceConfig& from = all.sources[size_t(source)];
        replayed_ |= from.kind == "replay";
        present |= 1u << signal;
        (c.wait ? align.waited : align.others) |= 1u << signal;
        if (c.address >= 0) {
            const RegisterField field(c);
            registers_.push_back({source, signal, field, Scaler(c, field.number, field.count * 16u), uint8_t(from.unit)});
        } else {
            const CanField field(c);
            can_.push_back({source, signal, field, Scaler(c, field.number, field.bits.length), int64_t(c.delay_s * 1e9)});
        }
    }
    if (config_.has_counter) {
        counter_source_ = source_index(all.sources, config_.counter.source);
        if (config_.counter.address >= 0) counter_register_ = std::make_unique<RegisterField>(config_.counter);
        else counter_ = std::make_unique<CanField>(config_.counter);
        counter_unit_ = unsigned(all.sources[size_t(counter_source_)].unit);
    }
    align.tolerance_ns = int64_t((config_.align_tolerance_s > 0 ? config_.align_tolerance_s : config_.sync.empty() ? 0.5 * config_.dt_s : config_.dt_s) * 1e9);
    if (!config_.sync.empty()) {
        driveid_signal sync;
        driveid_signal_from_name(config_.sync.c_str(), &sync);
        align.sync = sync;
    }
    aligner_ = Aligner(align);
    pacer_ = Pacer(int64_t((config_.count_s > 0 ? config_.count_s : config_.dt_s) * 1e9), int64_t(std::max(50 * config_.dt_s, config_.gap_s) * 1e9));
    make_shifter(all, align.waited);
    try {
        make_estimator(present);
    } catch (const std::runtime_error& e) {
        throw std::runtime_error(where(all, config_) + e.what());
    }
}

// Motion keeps its instants; what drives it is moved.
void Drive::make_shifter(const Config& all, uint32_t waited) {
    uint32_t motion = 0;
    for (auto s : {DRIVEID_SIGNAL_THETA_RAD, DRIVEID_SIGNAL_OMEGA_RAD_S, DRIVEID_SIGNAL_THETA_L_RAD, DRIVEID_SIGNAL_OMEGA_L_RAD_S, DRIVEID_SIGNAL_X_M, DRIVEID_SIGNAL_V_M_S, DRIVEID_SIGNAL_Y}) motion |= 1u << s;
    if (config_.skew_s != 0 && (!(waited & motion) || !(waited & ~motion)))
        throw std::runtime_error(where(all, config_) + "skew_s lies between motion and what drives it: configure signals of both (wait = true), or remove it");
    shifter_ = Shifter(int64_t(config_.skew_s * 1e9), waited & ~motion, int64_t((config_.gap_s > 0 ? config_.gap_s : 5 * config_.dt_s) * 1e9));
}

// From the model; without one, the sinusoids of the one signal.
void Drive::make_online(uint32_t present) {
    char reason[512] = "";
    if (has_no_model()) {
        driveid_signal signal;
        driveid_signal_from_name(config_.signals[0].name.c_str(), &signal);
        driveid_regression sinusoids;
        driveid_frequency_regression(uint32_t(std::max<int64_t>(1, config_.sinusoids)), 2 * M_PI * config_.highest_Hz, &sinusoids);
        driveid_online_sinusoids(&online_, &sinusoids, signal);
        return;
    }
    const driveid_status s = driveid_online_init(&online_, &model_, present, reason, sizeof reason);
    if (s != DRIVEID_OK) throw std::runtime_error(clean(reason, s));
}

void Drive::make_estimator(uint32_t present) {
    char reason[512] = "";
    make_online(present);
    for (const auto& c : config_.signals) {
        driveid_signal signal;
        driveid_signal_from_name(c.name.c_str(), &signal);
        const driveid_hold hold = c.hold == "zoh" ? DRIVEID_HOLD_ZERO : c.hold == "average" ? DRIVEID_HOLD_AVERAGE : DRIVEID_HOLD_FIRST;
        if (!c.hold.empty()) driveid_online_hold(&online_, signal, hold);  // a signal that the regression does not use has no hold
    }
    fresh_online_ = online_;
    if (online_.present & ~present) throw std::runtime_error("a signal that the structure needs is not configured");
    const driveid_real type = config_.type == "f32" ? DRIVEID_F32 : config_.type == "q31" ? DRIVEID_Q31 : DRIVEID_F64;
    const size_t size = driveid_estimator_size(config_.method.c_str(), type);
    if (size == 0) throw std::runtime_error("method \"" + config_.method + "\" does not exist in type " + config_.type + ": " + DRIVEID_ESTIMATOR_METHODS);
    estimator_.assign((size + sizeof(std::max_align_t) - 1) / sizeof(std::max_align_t), {});
    driveid_estimator_options options{};
    options.dt_s = config_.dt_s;
    options.bandwidth_rad_s = config_.motion_rad_s > 0 ? suggested(config_) : config_.bandwidth_rad_s;
    options.forgetting_s = config_.forgetting_s;
    options.gap_s = config_.gap_s;
    options.alarm = config_.alarm;
    if (type == DRIVEID_Q31) declare_ranges(options.range);
    const driveid_status s = driveid_estimator_configure(estimator(), size, config_.method.c_str(), type, &online_.regression, &options, reason, sizeof reason);
    if (s != DRIVEID_OK) throw std::runtime_error(clean(reason, s));
    make_watch();
    parameters_.resize(online_.physical);
    for (size_t k = 0; k < parameters_.size(); ++k) {
        snprintf(parameters_[k].name, sizeof parameters_[k].name, "%s", online_.physical_name[k]);
        snprintf(parameters_[k].unit, sizeof parameters_[k].unit, "%s", online_.physical_unit[k]);
    }
}

// Scales of a fixed-point estimator. The speed may be none of the signals and still be in the equations (psi_pm omega): then the drive declares it.
void Drive::declare_ranges(double* channel_range) const {
    double range[DRIVEID_SIGNAL_COUNT] = {};
    std::string missing;
    for (const auto& c : config_.signals) {
        driveid_signal signal;
        driveid_signal_from_name(c.name.c_str(), &signal);
        range[signal] = c.range;
        if (c.range <= 0 && (online_.present >> signal & 1)) missing += " " + c.name;
    }
    if (!missing.empty()) throw std::runtime_error("type q31 needs `range` of the signals" + missing);
    for (const auto signal : {DRIVEID_SIGNAL_OMEGA_RAD_S, DRIVEID_SIGNAL_V_M_S})
        if (range[signal] <= 0) range[signal] = config_.speed_range;
    driveid_online_ranges(&online_, range, channel_range);
    if (std::any_of(channel_range, channel_range + online_.regression.channels, [](double r) { return r <= 0; }))
        throw std::runtime_error("type q31 needs `speed_range`: the speed, which is no signal here, stands in the equations");
}

// The loaded model beside the drive; a structure without a torque or force balance has nothing to watch. Storage is kept over restarts.
void Drive::make_watch() {
    if (!config_.watch || online_.mechanical < 0) return;
    watch_.resize((driveid_watch_size() + sizeof(std::max_align_t) - 1) / sizeof(std::max_align_t));
    if (driveid_watch_init(watcher(), &fresh_online_, config_.dt_s) != DRIVEID_OK) watch_.clear();
}

}  // namespace gw
