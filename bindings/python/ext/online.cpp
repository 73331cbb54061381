// SPDX-License-Identifier: Apache-2.0
// model.h (on-line form) and estimate.h: samples in, parameters out, with the very functions that the daemon calls.
#include "records.hpp"

#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <memory>
#include <new>

#include <driveid/frequency.h>
#include <driveid/model.h>
#include <driveid/model_file.h>

namespace driveid_ext {
namespace {

struct Options {
    double dt_s = 0, bandwidth_rad_s = 0, forgetting_s = 0, gap_s = 0, alarm = 0;
    uint32_t sinusoids = 0;  // above 0: no model, the sinusoids of one signal
    double highest_rad_s = 0;
};

[[noreturn]] void refuse(const std::string &what, driveid_status status, const std::string &reason) {
    throw nb::value_error((what + ": " + (reason.empty() ? driveid_status_text(status) : reason)).c_str());
}

driveid_real real_of(const std::string &type) {
    if (type == "f64") return DRIVEID_F64;
    if (type == "f32") return DRIVEID_F32;
    if (type == "q31") return DRIVEID_Q31;
    throw nb::value_error(("type is \"f64\", \"f32\" or \"q31\", not \"" + type + "\"").c_str());
}

driveid_hold hold_of(const std::string &hold) {
    if (hold == "instant") return DRIVEID_HOLD_FIRST;
    if (hold == "zoh") return DRIVEID_HOLD_ZERO;
    if (hold == "average") return DRIVEID_HOLD_AVERAGE;
    throw nb::value_error(("hold is \"instant\", \"zoh\" or \"average\", not \"" + hold + "\"").c_str());
}

// Storage of one estimator, aligned for any method; copy() of it is a snapshot.
class Storage {
public:
    explicit Storage(size_t size) : size_(size), bytes_(static_cast<std::byte *>(::operator new(size, std::align_val_t(64)))) {
        std::memset(bytes_, 0, size);
    }
    Storage(const Storage &o) : Storage(o.size_) { std::memcpy(bytes_, o.bytes_, size_); }
    Storage &operator=(const Storage &) = delete;
    ~Storage() { ::operator delete(bytes_, std::align_val_t(64)); }
    driveid_estimator *get() const { return reinterpret_cast<driveid_estimator *>(bytes_); }
    size_t size() const { return size_; }

private:
    size_t size_;
    std::byte *bytes_;
};

class Online {
public:
    Online(const std::string &model_toml, const std::vector<std::string> &signals, const std::string &method, const std::string &type,
           const Options &options, const std::vector<std::pair<std::string, std::string>> &holds, const std::vector<std::pair<std::string, double>> &ranges) {
        if (options.sinusoids > 0) sinusoids(signals, options);
        else model(model_toml, signals);
        for (const auto &[name, hold] : holds) {
            driveid_online_hold(&online_, signal_of(name), hold_of(hold));  // a signal that the regression does not use has no hold
        }
        const driveid_real real = real_of(type);
        const size_t size = driveid_estimator_size(method.c_str(), real);
        if (size == 0) throw nb::value_error(("method \"" + method + "\", type " + type + ": " DRIVEID_ESTIMATOR_METHODS).c_str());
        storage_ = std::make_unique<Storage>(size);
        driveid_estimator_options o{};
        o.dt_s = options.dt_s;
        o.bandwidth_rad_s = options.bandwidth_rad_s;
        o.forgetting_s = options.forgetting_s;
        o.gap_s = options.gap_s;
        o.alarm = options.alarm;
        double range[DRIVEID_SIGNAL_COUNT] = {};
        for (const auto &[name, value] : ranges) range[signal_of(name)] = value;
        driveid_online_ranges(&online_, range, o.range);
        std::string reason(1024, '\0');
        const driveid_status status = driveid_estimator_configure(storage_->get(), size, method.c_str(), real, &online_.regression, &o, reason.data(), reason.size());
        if (status != DRIVEID_OK) refuse("estimator", status, reason.c_str());
    }
    Online(const Online &o) : online_(o.online_), storage_(std::make_unique<Storage>(*o.storage_)) {}

    nb::list parameters() const {
        nb::list out;
        for (uint32_t i = 0; i < online_.physical; i++) out.append(online_.physical_name[i]);
        return out;
    }
    std::string missing() const { return online_.missing; }
    size_t bytes() const { return storage_->size(); }
    void restart() { driveid_estimator_restart(storage_->get()); }

    // One sample a row. NaN: the signal was absent in that sample. An estimate is asked for at every `every`-th row and at the last.
    nb::dict run(const Stamps &t_ns, const std::vector<std::pair<std::string, Values>> &columns, size_t every) {
        const size_t rows = t_ns.shape(0), n = online_.physical;
        std::vector<std::pair<int, const double *>> inputs;
        for (const auto &[name, values] : columns) {
            const driveid_signal s = signal_of(name);
            if (values.shape(0) != rows) throw nb::value_error(("column " + name + " has not as many rows as t_ns").c_str());
            inputs.emplace_back(s, values.data());
        }
        if (every == 0) throw nb::value_error("every is at least 1");
        Rows out(rows, n);
        {
            nb::gil_scoped_release release;
            for (size_t r = 0; r < rows; r++) step(t_ns.data()[r], r, inputs, (r + 1) % every == 0 || r + 1 == rows, out);
        }
        nb::dict d;
        d["status"] = array(std::move(out.status), {rows});
        d["row"] = array(std::move(out.row), {out.count});
        d["estimate_status"] = array(std::move(out.estimate_status), {out.count});
        d["value"] = array(std::move(out.value), {out.count, n});
        d["lo"] = array(std::move(out.lo), {out.count, n});
        d["hi"] = array(std::move(out.hi), {out.count, n});
        d["valid"] = array(std::move(out.valid), {out.count, n});
        d["restarts"] = array(std::move(out.restarts), {out.count});
        d["residual_rms"] = array(std::move(out.residual), {out.count});
        return d;
    }

private:
    static driveid_signal signal_of(const std::string &name) {
        driveid_signal s;
        if (driveid_signal_from_name(name.c_str(), &s) != DRIVEID_OK) throw nb::value_error(("no signal is called " + name).c_str());
        return s;
    }

    void model(const std::string &toml, const std::vector<std::string> &signals) {
        driveid_model model{};
        std::string reason(1024, '\0');
        driveid_status status = driveid_model_read(toml.c_str(), &model, reason.data(), reason.size());
        if (status != DRIVEID_OK) refuse("model", status, reason.c_str());
        uint32_t bits = 0;
        for (const std::string &name : signals) bits |= UINT32_C(1) << signal_of(name);
        reason.assign(1024, '\0');
        status = driveid_online_init(&online_, &model, bits, reason.data(), reason.size());
        if (status != DRIVEID_OK) refuse("model on line", status, reason.c_str());
    }

    void sinusoids(const std::vector<std::string> &signals, const Options &options) {
        driveid_regression regression;
        if (signals.size() != 1) throw nb::value_error("sinusoids are looked for in one signal");
        driveid_status status = driveid_frequency_regression(options.sinusoids, options.highest_rad_s, &regression);
        if (status == DRIVEID_OK) status = driveid_online_sinusoids(&online_, &regression, signal_of(signals[0]));
        if (status != DRIVEID_OK) refuse("sinusoids", status, "1 or 2 of them, and the highest frequency above 0");
    }

    struct Rows {
        Rows(size_t rows, size_t) : status(rows) {}
        std::vector<int8_t> status;
        std::vector<int64_t> row;
        std::vector<int8_t> estimate_status;
        std::vector<double> value, lo, hi, residual;
        std::vector<uint8_t> valid;
        std::vector<uint32_t> restarts;
        size_t count = 0;
    };

    void step(int64_t t_ns, size_t r, const std::vector<std::pair<int, const double *>> &inputs, bool ask, Rows &out) {
        driveid_sample sample{};
        sample.stamp = {t_ns, 0, DRIVEID_CLOCK_RECORD};
        for (const auto &[s, values] : inputs)
            if (!std::isnan(values[r])) {
                sample.present |= UINT32_C(1) << s;
                sample.value[s] = values[r];
            }
        double channel[DRIVEID_CHANNELS_MAX] = {};
        driveid_status status = driveid_online_channels(&online_, &sample, channel);
        if (status == DRIVEID_OK) status = driveid_estimator_update(storage_->get(), online_.t_ns, channel);
        out.status[r] = static_cast<int8_t>(status);
        if (ask) estimate(r, out);
    }

    void estimate(size_t r, Rows &out) const {
        constexpr double nan = std::numeric_limits<double>::quiet_NaN();
        driveid_estimate e{};
        driveid_param p[DRIVEID_THETA_MAX] = {};
        uint32_t valid = 0;
        driveid_status status = driveid_estimator_estimate(storage_->get(), &e);
        // As the daemon does: with weak excitation some parameters may still be trusted, and the mask says which.
        const bool written = status == DRIVEID_OK || status == DRIVEID_WEAK_EXCITATION || status == DRIVEID_RANK || status == DRIVEID_FROZEN;
        const bool have = written && driveid_online_physical(&online_, &e, p, &valid) == DRIVEID_OK;
        out.row.push_back(static_cast<int64_t>(r));
        out.estimate_status.push_back(static_cast<int8_t>(status));
        for (uint32_t i = 0; i < online_.physical; i++) {
            out.value.push_back(have ? p[i].value : nan);
            out.lo.push_back(have ? p[i].lo : nan);
            out.hi.push_back(have ? p[i].hi : nan);
            out.valid.push_back(have && (valid >> i & 1));
        }
        out.restarts.push_back(have ? e.restarts : 0);
        out.residual.push_back(have ? e.residual_rms : nan);
        out.count++;
    }

    driveid_online online_{};
    std::unique_ptr<Storage> storage_;
};

}  // namespace

void bind_online(nb::module_ &m) {
    nb::class_<Online>(m, "Online", "A model made ready for an on-line estimator, and the estimator: what the daemon runs for one drive.")
        .def(
            "__init__",
            [](Online *self, const std::string &model_toml, const std::vector<std::string> &signals, const std::string &method,
               const std::string &type, double dt_s, double bandwidth_rad_s, double forgetting_s, double gap_s, double alarm,
               const std::vector<std::pair<std::string, std::string>> &holds, const std::vector<std::pair<std::string, double>> &ranges, uint32_t sinusoids, double highest_rad_s) {
                new (self) Online(model_toml, signals, method, type, {dt_s, bandwidth_rad_s, forgetting_s, gap_s, alarm, sinusoids, highest_rad_s}, holds, ranges);
            },
            nb::arg("model_toml"), nb::arg("signals"), nb::kw_only(), nb::arg("method") = "fsm", nb::arg("type") = "f64", nb::arg("dt_s"),
            nb::arg("bandwidth_rad_s") = 0.0, nb::arg("forgetting_s") = 0.0, nb::arg("gap_s") = 0.0, nb::arg("alarm") = 0.0, nb::arg("holds") = std::vector<std::pair<std::string, std::string>>(),
            nb::arg("ranges") = std::vector<std::pair<std::string, double>>(), nb::arg("sinusoids") = 0, nb::arg("highest_rad_s") = 0.0)
        .def("__copy__", [](const Online &o) { return new Online(o); })
        .def("__deepcopy__", [](const Online &o, nb::handle) { return new Online(o); }, nb::arg("memo"))
        .def_prop_ro("parameters", &Online::parameters, "Names of the physical parameters.")
        .def_prop_ro("missing", &Online::missing, "Parameters that these signals cannot give, and what to record.")
        .def_prop_ro("bytes", &Online::bytes, "Size of the estimator's storage.")
        .def("restart", &Online::restart)
        .def("run", &Online::run, nb::arg("t_ns"), nb::arg("columns"), nb::arg("every") = 1);
}

}  // namespace driveid_ext
