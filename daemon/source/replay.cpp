// SPDX-License-Identifier: Apache-2.0
#include "source/replay.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "base/clock.hpp"
#include "base/log.hpp"

namespace gw {

namespace {

constexpr int kATurn = 512;           // messages before the loop looks at its descriptors again
constexpr size_t kLongestLine = 4096;

bool frame_of(const std::vector<uint8_t>& p, Recorded& out) {
    if (p.size() < 8) return false;
    memset(&out.frame, 0, sizeof out.frame);
    memcpy(&out.frame.can_id, p.data(), 4);
    out.fd = p[4] & 1u;
    // Record flags: 1 FD, 2 BRS, 4 ESI. Linux: BRS 1, ESI 2.
    out.frame.flags = uint8_t((p[4] & 2u ? CANFD_BRS : 0) | (p[4] & 4u ? CANFD_ESI : 0));
    out.frame.len = p[5];
    if (p[5] > (out.fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN) || p.size() < 8u + p[5]) return false;
    memcpy(out.frame.data, p.data() + 8, p[5]);
    out.is_frame = true;
    return true;
}

bool reply_of(const std::vector<uint8_t>& p, Recorded& out) {
    if (p.size() < 8) return false;
    ModbusReply& r = out.reply;
    r.unit = p[0], r.function = p[1];
    memcpy(&r.address, p.data() + 2, 2);
    memcpy(&r.count, p.data() + 4, 2);
    if (r.count > 125 || p.size() < 8u + 2u * r.count) return false;
    memcpy(r.registers, p.data() + 8, 2u * r.count);
    out.is_frame = false;
    return true;
}

}  // namespace

ReplaySource::ReplaySource(const SourceConfig& config, int index, Consumer& consumer, std::string path)
    : Source(config, index, consumer), path_(std::move(path)), is_drec_(path_.ends_with(".drec")) {
    payload_.reserve(kDrecPayloadMax);
    line_.reserve(kLongestLine);
}

void ReplaySource::start() {
    std::string error;
    bool open;
    if (is_drec_) {
        open = drec_.open(path_, error);
        const std::string& named = config_.recorded_source.empty() ? config_.name : config_.recorded_source;
        for (const auto& s : drec_.sources()) wanted_.push_back(s.name == named);
        const bool any = std::find(wanted_.begin(), wanted_.end(), true) != wanted_.end();
        if (!any && config_.recorded_source.empty()) wanted_.clear();
        if (open && !any && !config_.recorded_source.empty()) error = path_ + ": holds no source \"" + named + "\"", open = false;
    } else {
        log_.open(path_, std::ios::binary);
        open = log_.good();
        if (!open) error = path_ + ": " + strerror(errno) + "; check name and permissions";
    }
    if (!open) {
        status_.state = "closed";
        status_.last_error = error;
        log_event(Level::error, config_.name.c_str(), "open", "name a .drec or a candump .log", "%s", error.c_str());
        return;
    }
    if (is_drec_ && !drec_.header_readable())
        log_event(Level::warning, config_.name.c_str(), "header", "every frame is taken, whatever its source", "%s: its header is damaged: the names of its sources are lost", path_.c_str());
    status_.state = "open";
    status_.clock = "record";
    advance();
}

bool ReplaySource::wanted(uint16_t source) const { return wanted_.empty() || (source < wanted_.size() && wanted_[source]); }

bool ReplaySource::from_drec() {
    EntryHeader h;
    while (drec_.next(h, payload_)) {
        if (!wanted(h.source)) continue;
        const bool ok = h.kind == EntryKind::can_frame ? frame_of(payload_, next_) : h.kind == EntryKind::modbus_reply && reply_of(payload_, next_);
        if (!ok) continue;
        next_.t_ns = h.t_ns;
        next_.stamp = {h.t_ns, h.err_ns, DRIVEID_CLOCK_RECORD};
        return true;
    }
    return false;
}

bool ReplaySource::from_candump() {
    CandumpLine parsed;
    while (std::getline(log_, line_)) {
        if (line_.empty()) continue;
        if (line_.size() > kLongestLine || !candump_parse(line_, parsed)) {
            ++status_.errors;
            log_event(Level::warning, config_.name.c_str(), "line", "the line is skipped", "%s: a line is no candump frame", path_.c_str());
            continue;
        }
        if (!config_.recorded_source.empty() && parsed.interface != config_.recorded_source) continue;
        next_.t_ns = parsed.t_ns;
        next_.stamp = {parsed.t_ns, 1000, DRIVEID_CLOCK_RECORD};
        next_.is_frame = true;
        next_.fd = parsed.fd;
        next_.frame = parsed.frame;
        return true;
    }
    return false;
}

void ReplaySource::advance() {
    pending_ = is_drec_ ? from_drec() : from_candump();
    if (is_drec_) status_.errors = drec_.damaged();
    if (pending_) return;
    status_.state = "ended";
    tell_end();
    consumer_.on_end(index_);
}

void ReplaySource::tell_end() {
    const char* name = config_.name.c_str();
    if (is_drec_ && drec_.damaged() > 0)
        log_event(Level::warning, name, "damaged", "what is whole was taken", "%s: %llu damaged stretches were skipped", path_.c_str(), static_cast<unsigned long long>(drec_.damaged()));
    if (status_.frames > 0) return;
    status_.last_error = path_ + ": holds no frame of this source";
    log_event(Level::error, name, "empty", "name a .drec or a candump .log that holds its frames", "%s", status_.last_error.c_str());
}

void ReplaySource::deliver() {
    const Recorded& r = next_;
    if (!r.is_frame) {
        count(consumer_.on_reply(index_, r.reply, r.stamp));
    } else if (r.frame.can_id & CAN_ERR_FLAG) {
        ++status_.errors;
    } else {
        count(consumer_.on_frame(index_, r.frame, r.fd, r.stamp));
    }
    advance();
}

void Player::start() {
    start_mono_ns_ = monotonic_ns();
    start_recorded_ns_ = INT64_MAX;
    for (auto* s : sources_)
        if (s->pending()) start_recorded_ns_ = std::min(start_recorded_ns_, s->next().t_ns);
    play();
}

// Monotonic instant at which the next message is due; the earliest possible for a source without pace.
int64_t Player::due(const ReplaySource& s) const {
    const double speed = s.config().speed;
    if (speed <= 0) return INT64_MIN;
    return start_mono_ns_ + int64_t(double(s.next().t_ns - start_recorded_ns_) / speed);
}

bool Player::work() {
    for (int k = 0; k < kATurn; ++k) {
        ReplaySource* first = nullptr;
        for (auto* s : sources_) {
            if (!s->pending() || s->config().speed > 0) continue;
            if (!first || s->next().t_ns < first->next().t_ns) first = s;
        }
        if (!first) return false;
        if (consumer_.busy()) {
            timer_.start(1000000, 0);
            return false;
        }
        first->deliver();
    }
    return true;
}

void Player::play() {
    const int64_t now = monotonic_ns();
    for (int k = 0; k < kATurn; ++k) {
        ReplaySource* first = nullptr;
        for (auto* s : sources_)
            if (s->pending() && s->config().speed > 0 && (!first || due(*s) < due(*first))) first = s;
        if (!first) return;
        if (due(*first) > now) return timer_.start(due(*first) - now, 0);
        first->deliver();
    }
    timer_.start(1, 0);
}

bool Player::ended() const {
    return std::none_of(sources_.begin(), sources_.end(), [](auto* s) { return s->pending(); });
}

}  // namespace gw
