// SPDX-License-Identifier: Apache-2.0
// One frame a parameter, identifiers counting up from can_id. Layout (little-endian, 8 bytes, docs/manual/configuration.md and the DBC):
//   bytes 0..3  value, f32 SI
//   bytes 4..5  half-width of the 95 % interval, u16 in 1e-4 of |value|; 65535: larger than that, or unknown
//   byte  6     bit 0 valid; bits 4..7 state (waiting 0, identifying 1, valid 2, frozen 3, stale 4, error 5)
//   byte  7     age, 0.1 s; 254: 25.4 s or more; 255: there has been no value yet (value is 0 then)
#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/clock.hpp"
#include "base/log.hpp"
#include "sink/layout.hpp"
#include "sink/make_sink.hpp"
#include "sink/modbus_server.hpp"

namespace gw {

uint16_t relative_half_width(const ParameterReport& p) {
    const double half = 0.5 * (p.hi - p.lo);
    if (!p.known || !(half >= 0) || p.value == 0) return 65535;
    const double relative = std::ceil(half / std::abs(p.value) * 1e4);  // never narrower than it is
    return relative < 65535 ? uint16_t(relative) : uint16_t(65535);
}

uint8_t age_byte(const Drive& d, const ParameterReport& p, int64_t now_ns) {
    if (!p.known) return 255;
    return uint8_t(std::clamp(d.age_s(p, now_ns) * 10, 0.0, 254.0));
}

canfd_frame parameter_frame(const Drive& d, const ParameterReport& p, uint32_t can_id, bool extended, int64_t now_ns) {
    canfd_frame f{};
    f.can_id = can_id | (extended ? CAN_EFF_FLAG : 0);
    f.len = 8;
    const float value = p.known ? float(p.value) : 0.0f;
    const uint16_t half = relative_half_width(p);
    memcpy(f.data, &value, 4);
    memcpy(f.data + 4, &half, 2);
    f.data[6] = uint8_t((d.valid(p, now_ns) ? 1 : 0) | int(d.state(now_ns)) << 4);
    f.data[7] = age_byte(d, p, now_ns);
    return f;
}

namespace {

class CanSink final : public Sink {
public:
    CanSink(const SinkConfig& config, Source& bus, const Drive& drive, Loop& loop)
        : Sink(config), bus_(bus), drive_(drive), timer_(loop, [this] { send(); }) {}

    void start() override {
        status_.state = "open";
        const int64_t period = int64_t(config_.period_s * 1e9);
        timer_.start(period, period);
    }
    std::string address() const override {
        char text[64];
        snprintf(text, sizeof text, "%s 0x%X", bus_.config().name.c_str(), unsigned(config_.can_id));
        return text;
    }

private:
    // A frame that cannot go now is dropped: nothing is queued, so nothing stale is sent after an outage.
    void send() {
        const int64_t now = monotonic_ns();
        uint32_t id = uint32_t(config_.can_id);
        for (const auto& p : drive_.parameters()) {
            const bool went = bus_.send(parameter_frame(drive_, p, id++, config_.extended, now), false);
            ++(went ? status_.sent : status_.dropped);
            if (went != was_open_) {
                was_open_ = went;
                status_.state = went ? "open" : "blocked";
                status_.last_error = went ? "" : "the bus does not take frames";
                if (!went) log_event(Level::warning, config_.name.c_str(), "blocked", "check the bus; frames are dropped until it is back", "the bus does not take frames");
            }
        }
    }

    Source& bus_;
    const Drive& drive_;
    Timer timer_;
    bool was_open_ = true;
};

class RecordSink final : public Sink {
public:
    RecordSink(const SinkConfig& config, std::unique_ptr<RecordWriter> writer, Loop& loop) : Sink(config), writer_(std::move(writer)), timer_(loop, [this] { look(); }) {}
    void start() override { timer_.start(1, 200000000); }
    std::string address() const override { return writer_->path(); }

private:
    void look() {
        status_.sent = writer_->entries();
        status_.dropped = writer_->dropped();
        const int error = writer_->error();
        status_.state = writer_->full() ? "full" : error ? "error" : "open";
        status_.last_error = error ? strerror(error) : "";
        if (error && error != told_) log_event(Level::error, config_.name.c_str(), "disk", "make room or mend the folder; it goes on by itself", "%s: %s", writer_->path().c_str(), strerror(error));
        told_ = error;
    }
    std::unique_ptr<RecordWriter> writer_;
    Timer timer_;
    int told_ = 0;
};

}  // namespace

std::unique_ptr<Sink> make_record_sink(const SinkConfig& config, std::unique_ptr<RecordWriter> writer, Loop& loop) {
    return std::make_unique<RecordSink>(config, std::move(writer), loop);
}

std::unique_ptr<Sink> make_sink(const SinkConfig& config, const std::vector<std::unique_ptr<Source>>& sources,
                                const std::vector<std::unique_ptr<Drive>>& drives, Loop& loop) {
    if (config.kind == "modbus_server") {
        std::vector<const Drive*> shown;
        for (auto& d : drives)
            if (config.drive.empty() || d->config().name == config.drive) shown.push_back(d.get());
        return make_modbus_server(config, std::move(shown), loop);
    }
    const auto bus = std::find_if(sources.begin(), sources.end(), [&](auto& s) { return s->config().name == config.source; });
    const auto drive = std::find_if(drives.begin(), drives.end(), [&](auto& d) { return d->config().name == config.drive; });
    return std::make_unique<CanSink>(config, **bus, **drive, loop);
}

}  // namespace gw
