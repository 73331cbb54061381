// SPDX-License-Identifier: Apache-2.0
#include "gateway.hpp"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <unistd.h>

#include <driveid/version.h>

#include "base/clock.hpp"
#include "control/describe.hpp"
#include "sink/make_sink.hpp"
#include "source/make_source.hpp"

namespace gw {

namespace {

std::string joined(const std::vector<std::string>& lines) {
    std::string all;
    for (const auto& l : lines) all += (all.empty() ? "" : "\n") + l;
    return all;
}

std::string created() {
    char text[40];
    const time_t now = time(nullptr);
    tm utc;
    gmtime_r(&now, &utc);
    strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
    return text;
}

uint32_t saturate_u32(int64_t v) { return uint32_t(std::clamp<int64_t>(v, 0, UINT32_MAX)); }

}  // namespace

std::vector<std::unique_ptr<Drive>> build_drives(const Config& config, DriveListener& listener, std::vector<std::string>& errors) {
    std::vector<std::unique_ptr<Drive>> drives;
    for (const auto& d : config.drives) {
        try {
            drives.push_back(std::make_unique<Drive>(d, config, int(drives.size()), listener));
        } catch (const std::exception& e) {
            errors.emplace_back(e.what());
        }
    }
    return drives;
}

Gateway::Gateway(Config config, Loop& loop, Observer* observer)
    : config_(std::move(config)), loop_(loop), observer_(observer), player_(loop, *this) {
    std::vector<std::string> errors;
    drives_ = build_drives(config_, *this, errors);
    if (errors.empty()) check_transmit(config_, drives_, errors);
    if (!errors.empty()) throw std::runtime_error(joined(errors));
    make_sources();
    make_sinks();
    route();
}

Gateway::~Gateway() = default;

void Gateway::make_sources() {
    for (size_t k = 0; k < config_.sources.size(); ++k) {
        sources_.push_back(make_source(config_, int(k), *this, loop_));
        if (auto* replay = dynamic_cast<ReplaySource*>(sources_.back().get())) player_.add(replay);
    }
}

void Gateway::make_sinks() {
    for (const auto& s : config_.sinks) {
        if (s.kind == "record") {
            std::string error;
            auto writer = make_record(s.file, error);
            if (!writer) throw std::runtime_error(config_.file + ":" + std::to_string(s.place.line) + ": sink \"" + s.name + "\": " + error);
            writers_.push_back(writer.get());
            sinks_.push_back(make_record_sink(s, std::move(writer), loop_));
        } else {
            sinks_.push_back(make_sink(s, sources_, drives_, loop_));
        }
    }
}

void Gateway::route() {
    listeners_.resize(sources_.size());
    for (size_t s = 0; s < sources_.size(); ++s)
        for (auto& d : drives_)
            if (d->uses(int(s))) listeners_[s].push_back(d.get());
}

void Gateway::start() {
    const std::string& file = record_again_.empty() ? config_.record.file : record_again_;
    if (!record_ && !file.empty()) {
        const std::string error = record_start(file);
        if (!error.empty()) log_event(Level::error, "record", "start", "mend [record] folder or file", "%s", error.c_str());
    }
    for (auto& s : sinks_) s->start();
    for (auto& s : sources_) s->start();
    player_.start();
}

Drive* Gateway::drive(const std::string& name) const {
    for (auto& d : drives_)
        if (d->config().name == name) return d.get();
    return nullptr;
}

bool Gateway::alive() {
    const bool moved = progress_ != last_progress_;
    last_progress_ = progress_;
    return moved || std::none_of(sources_.begin(), sources_.end(), [](auto& s) { return s->waiting(); });
}

void Gateway::tick(double elapsed_s) {
    for (auto& s : sources_) s->tick(elapsed_s);
}

bool Gateway::same_as(const Gateway& other) const { return record_layout() == other.record_layout(); }

void Gateway::adopt(Gateway& previous, std::vector<std::string>& changed) {
    const auto source_texts = [](const Config& c, const DriveConfig& d) {
        std::string text;
        for (const auto& signal : d.signals)
            for (const auto& s : c.sources)
                if (s.name == signal.source) text += config_text(s);
        return text;
    };
    for (auto& d : drives_) {
        Drive* old = previous.drive(d->config().name);
        const bool same = old && config_text(old->config()) == config_text(d->config()) && old->same_model(*d) &&
                          source_texts(previous.config_, old->config()) == source_texts(config_, d->config());
        if (same) d->take(*old);
        else changed.push_back("drive " + d->config().name);
    }
    for (auto& d : previous.drives_)
        if (!drive(d->config().name)) changed.push_back("drive " + d->config().name + " (removed)");
    const auto list = [&](const char* what, const auto& now, const auto& before) {
        for (const auto& n : now)
            if (std::none_of(before.begin(), before.end(), [&](auto& b) { return config_text(b) == config_text(n); })) changed.push_back(std::string(what) + " " + n.name);
    };
    list("source", config_.sources, previous.config_.sources);
    list("sink", config_.sinks, previous.config_.sinks);
    if (!previous.record_) return;
    record_name_ = previous.record_name_;
    if (record_layout() == previous.record_layout()) {
        record_ = std::move(previous.record_);
        return;
    }
    // Its entries would carry this gateway's numbers under the other one's names.
    record_again_ = record_name_;
    uint64_t bytes;
    previous.record_stop(bytes);
}

std::string Gateway::record_header() const {
    JsonOut j;
    const bool fresh = std::none_of(drives_.begin(), drives_.end(), [](auto& d) {
        return d->samples() > 0 || std::any_of(d->parameters().begin(), d->parameters().end(), [](auto& p) { return p.known; });
    });
    return j.open('{').field("driveid", DRIVEID_VERSION).field("created", created()).field("clock", "monotonic").field("from_start", fresh).raw(record_layout()).close('}').text();
}

std::string Gateway::record_layout() const {
    JsonOut j;
    j.key("sources").open('[');
    for (auto& s : sources_) j.open('{').field("name", s->config().name).field("kind", s->config().kind).field("address", s->address()).close('}');
    j.close(']').key("drives").open('[');
    for (auto& d : drives_) j.string(d->config().name);
    j.close(']').key("models").open('[');
    for (auto& d : drives_) j.string(d->model_text());
    return j.close(']').field("config", config_.text).text();
}

std::unique_ptr<RecordWriter> Gateway::make_record(const std::string& bare, std::string& error) {
    const bool control = std::any_of(bare.begin(), bare.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; });
    if (bare.empty() || bare.size() > 200 || control || bare.find('/') != std::string::npos || bare[0] == '.') {
        error = "file must be a bare name below the record folder, such as \"run.drec\"";
        return nullptr;
    }
    const std::string stem = bare.ends_with(".drec") ? bare.substr(0, bare.size() - 5) : bare;
    const std::string folder = std::filesystem::absolute(config_path(config_, config_.record.folder)).lexically_normal().string();
    // An earlier record is never overwritten.
    for (int k = 0; k < 10000; ++k) {
        const std::string path = folder + "/" + stem + (k ? "-" + std::to_string(k) : "") + ".drec";
        if (access(path.c_str(), F_OK) == 0) continue;
        return std::make_unique<RecordWriter>(path, record_header(), size_t(config_.record.buffer_bytes), uint64_t(config_.record.max_bytes));
    }
    error = "10000 records of this name exist already; choose another name";
    return nullptr;
}

std::string Gateway::record_start(const std::string& bare) {
    if (record_) return "a record is running: " + record_->path() + "; stop it first";
    std::string error;
    auto writer = make_record(bare, error);
    if (!writer) return error;
    if (writer->error()) return writer->path() + ": " + strerror(writer->error()) + "; mend the folder";
    record_ = std::move(writer);
    record_name_ = bare;
    log_event(Level::info, "record", "start", "", "recording into %s", record_->path().c_str());
    return "";
}

void Gateway::record_stop(uint64_t& bytes) {
    record_->finish();
    bytes = record_->bytes();
    record_.reset();
}

void Gateway::record_entry(EntryKind kind, uint16_t source, const driveid_stamp& stamp, const void* payload, size_t size) {
    const EntryHeader h{uint32_t(size), kind, uint8_t(stamp.clock), source, stamp.t_ns, saturate_u32(stamp.err_ns)};
    if (record_) record_->write(h, payload);
    for (auto* w : writers_) w->write(h, payload);
}

void Gateway::mark(const std::string& text) {
    if (!record_ && writers_.empty()) return;
    json_.clear();
    json_.open('{').field("driveid", DRIVEID_FORMAT).field("event", "mark").field("t_ns", monotonic_ns()).field("text", text).close('}');
    record_entry(EntryKind::mark, 0, {monotonic_ns(), 0, DRIVEID_CLOCK_DAEMON}, json_.text().data(), json_.text().size());
}

void Gateway::event(const LogEvent& e) {
    if (!record_ && writers_.empty()) return;
    json_.clear();
    describe_event(json_, e);
    record_entry(EntryKind::event, 0, {e.t_ns, 0, DRIVEID_CLOCK_DAEMON}, json_.text().data(), json_.text().size());
}

Fate Gateway::on_frame(int source, const canfd_frame& f, bool fd, const driveid_stamp& stamp) {
    ++progress_;
    if (record_ || !writers_.empty()) {
        uint8_t payload[8 + CANFD_MAX_DLEN];
        memcpy(payload, &f.can_id, 4);
        payload[4] = uint8_t((fd ? 1 : 0) | (fd && f.flags & CANFD_BRS ? 2 : 0) | (fd && f.flags & CANFD_ESI ? 4 : 0));
        payload[5] = f.len;
        payload[6] = payload[7] = 0;
        memcpy(payload + 8, f.data, f.len);
        record_entry(EntryKind::can_frame, uint16_t(source), stamp, payload, 8u + f.len);
    }
    bool used = false, rejected = false;
    for (Drive* d : listeners_[size_t(source)]) {
        const Fate fate = d->frame(source, f, f.can_id & CAN_EFF_FLAG, stamp);
        used |= fate == Fate::used;
        rejected |= fate == Fate::rejected;
    }
    return used ? Fate::used : rejected ? Fate::rejected : Fate::unused;
}

Fate Gateway::on_reply(int source, const ModbusReply& r, const driveid_stamp& stamp) {
    ++progress_;
    if (record_ || !writers_.empty()) {
        uint8_t payload[8 + 250];
        payload[0] = r.unit, payload[1] = r.function;
        memcpy(payload + 2, &r.address, 2);
        memcpy(payload + 4, &r.count, 2);
        payload[6] = payload[7] = 0;
        memcpy(payload + 8, r.registers, 2u * r.count);
        record_entry(EntryKind::modbus_reply, uint16_t(source), stamp, payload, 8u + 2u * r.count);
    }
    bool used = false, rejected = false;
    for (Drive* d : listeners_[size_t(source)]) {
        const Fate fate = d->reply(source, r, stamp);
        used |= fate == Fate::used;
        rejected |= fate == Fate::rejected;
    }
    return used ? Fate::used : rejected ? Fate::rejected : Fate::unused;
}

void Gateway::on_gap(int source, uint64_t lost) {
    for (Drive* d : listeners_[size_t(source)]) d->gap(source, lost);
}

void Gateway::on_end(int source) {
    log_event(Level::info, config_.sources[size_t(source)].name.c_str(), "end", "", "end of the record");
}

bool Gateway::busy() {
    return (record_ && record_->crowded()) || std::any_of(writers_.begin(), writers_.end(), [](auto* w) { return w->crowded(); });
}

void Gateway::on_sample(int drive, const driveid_sample& sample) {
    const Drive& d = *drives_[size_t(drive)];
    if ((record_ || !writers_.empty()) && d.config().record_samples) {
        uint8_t payload[4 + 8 * DRIVEID_SIGNAL_COUNT];
        size_t n = 4;
        memcpy(payload, &sample.present, 4);
        for (int s = 0; s < DRIVEID_SIGNAL_COUNT; ++s)
            if (sample.present >> s & 1u) memcpy(payload + n, &sample.value[s], 8), n += 8;
        record_entry(EntryKind::sample, uint16_t(drive), sample.stamp, payload, n);
    }
    if (observer_) observer_->sample(d, sample);
}

void Gateway::on_report(int drive) {
    const Drive& d = *drives_[size_t(drive)];
    if (record_ || !writers_.empty()) {
        json_.clear();
        describe_estimate(json_, d, d.last_ns());
        record_entry(EntryKind::estimate, uint16_t(drive), {d.last_ns(), 0, DRIVEID_CLOCK_RECORD}, json_.text().data(), json_.text().size());
    }
    if (observer_) observer_->report(d);
}

}  // namespace gw
