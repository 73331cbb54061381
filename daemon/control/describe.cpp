// SPDX-License-Identifier: Apache-2.0
#include "control/describe.hpp"

#include <cstdio>
#include <cstring>
#include <unistd.h>

#include <driveid/version.h>

#include "gateway.hpp"

namespace gw {

namespace {

void parameter(JsonOut& o, const Drive& d, const ParameterReport& p, int64_t now_ns) {
    o.open('{').field("name", p.name).key("value");
    if (p.known) {
        o.number(p.value).key("interval").open('[').number(p.lo).number(p.hi).close(']');
    } else {
        o.null().key("interval").null();
    }
    o.field("unit", p.unit).field("valid", d.valid(p, now_ns)).key("age_s");
    p.known ? o.number(d.age_s(p, now_ns)) : o.null();
    o.close('}');
}

void parameters(JsonOut& o, const Drive& d, int64_t now_ns) {
    o.key("parameters").open('[');
    for (const auto& p : d.parameters()) parameter(o, d, p, now_ns);
    o.close(']');
}

void residual(JsonOut& o, const Drive& d) {
    o.key("residual").open('{').field("rms", d.residual_rms()).field("unit", d.residual_unit()).field("alarm", d.alarm());
    o.key("since_ns");
    d.alarm() ? o.integer(d.alarm_since_ns()) : o.null();
    const driveid_watch_report* w = d.watch();
    o.key("usual_rms");
    w && w->ready ? o.number(w->usual_rms) : o.null();
    const bool mismatch = w && w->mismatch && d.alarm();  // the drive takes the watch's word with each report
    if (mismatch) {
        o.field("regime", driveid_watch_regime_name(w->regime)).field("likely_effect", w->effect).key("order");
        w->order > 0 ? o.number(w->order) : o.null();
        o.field("share", w->share);
    } else {
        o.key("regime").null().key("likely_effect").null().key("order").null().key("share").null();
    }
    o.key("not_told_apart_from").open('[');
    for (uint32_t k = 0; mismatch && k < w->ties; ++k) o.string(w->tie[k]);
    o.close(']');
    o.close('}');
}

// Of the readings as they come: what is corrected, and what the watch still sees.
void skew(JsonOut& o, const Drive& d) {
    const driveid_watch_report* w = d.watch();
    const double corrected_s = d.config().skew_s;
    o.key("skew").open('{').key("value_s");
    if (w && w->skew_known) {
        const double value_s = corrected_s + w->skew_s;
        o.number(value_s).key("interval_s").open('[').number(value_s - w->skew_half_s).number(value_s + w->skew_half_s).close(']');
    } else {
        o.null().key("interval_s").null();
    }
    o.field("corrected_s", corrected_s).close('}');
}

long memory_kB() {
    FILE* f = fopen("/proc/self/statm", "re");
    long size = 0, resident = 0;
    if (!f) return 0;
    if (fscanf(f, "%ld %ld", &size, &resident) != 2) resident = 0;
    fclose(f);
    return resident * (sysconf(_SC_PAGESIZE) / 1024);
}

}  // namespace

void describe_drive(JsonOut& o, const Drive& d, int64_t now_ns) {
    const DriveCounters c = d.counters();
    o.open('{').field("name", d.config().name).field("structure", d.structure()).field("method", d.config().method).field("type", d.config().type);
    o.field("state", drive_state_name(d.state(now_ns))).field("status", driveid_status_text(d.status())).field("t_ns", d.last_ns());
    o.field("samples", d.samples()).field("rate_Hz", d.rate_Hz()).field("jitter_ns", d.jitter_ns()).field("gaps", c.gaps).field("dropped", c.dropped);
    o.field("rejected", c.rejected).field("duplicates", c.duplicates).field("reordered", c.reordered).field("jumps", c.jumps).field("saturations", c.saturations);
    o.field("restarts", d.restarts()).key("time_to_first_trusted_s");
    d.first_trusted_s() >= 0 ? o.number(d.first_trusted_s()) : o.null();
    residual(o, d);
    skew(o, d);
    parameters(o, d, now_ns);
    o.field("missing", d.online().missing).close('}');
}

void describe_source(JsonOut& o, const Source& source) {
    const SourceStatus& s = source.status();
    o.open('{').field("name", source.config().name).field("kind", source.config().kind).field("address", source.address()).field("state", s.state);
    o.field("clock", s.clock).field("frames", s.frames).field("used", s.used).field("unused", s.unused).field("dropped", s.dropped);
    o.field("rejected", s.rejected).field("errors", s.errors).field("reopened", s.reopened).field("bus_state", s.bus_state).field("rate_Hz", s.rate_Hz);
    o.field("buffer_asked", s.buffer_asked).field("buffer_granted", s.buffer_granted).field("last_error", s.last_error).close('}');
}

void describe_sink(JsonOut& o, const Sink& sink) {
    const SinkStatus& s = sink.status();
    o.open('{').field("name", sink.config().name).field("kind", sink.config().kind).field("address", sink.address()).field("state", s.state);
    o.field("sent", s.sent).field("dropped", s.dropped).field("last_error", s.last_error).close('}');
}

void describe_status(JsonOut& o, const Gateway& g, int64_t now_ns) {
    o.field("t_ns", now_ns).key("drives").open('[');
    for (auto& d : g.drives()) describe_drive(o, *d, now_ns);
    o.close(']').key("sources").open('[');
    for (auto& s : g.sources()) describe_source(o, *s);
    o.close(']').key("sinks").open('[');
    for (auto& s : g.sinks()) describe_sink(o, *s);
    o.close(']').key("record");
    if (const RecordWriter* r = g.record()) {
        o.open('{').field("file", r->path()).field("entries", r->entries()).field("bytes", r->bytes()).field("dropped", r->dropped());
        o.field("state", r->full() ? "full" : r->error() ? "error" : "open").field("last_error", r->error() ? strerror(r->error()) : "").close('}');
    } else {
        o.null();
    }
    o.field("memory_kB", int64_t(memory_kB()));
}

void describe_estimate(JsonOut& o, const Drive& d, int64_t now_ns) {
    o.open('{').field("driveid", DRIVEID_FORMAT).field("event", "estimate").field("drive", d.config().name).field("t_ns", d.last_ns());
    o.field("state", drive_state_name(d.state(now_ns)));
    parameters(o, d, now_ns);
    residual(o, d);
    skew(o, d);
    o.close('}');
}

void describe_sample(JsonOut& o, const Drive& d, const driveid_sample& s) {
    o.open('{').field("driveid", DRIVEID_FORMAT).field("event", "sample").field("drive", d.config().name).field("t_ns", s.stamp.t_ns).key("values").open('{');
    for (int k = 0; k < DRIVEID_SIGNAL_COUNT; ++k)
        if (s.present >> k & 1u) o.field(driveid_signal_name(driveid_signal(k)), s.value[k]);
    o.close('}').close('}');
}

void describe_event(JsonOut& o, const LogEvent& e) {
    o.open('{').field("driveid", DRIVEID_FORMAT).field("event", "event").field("t_ns", e.t_ns).field("level", level_name(e.level));
    o.field("component", e.component).field("text", e.text).field("mend", e.mend).field("count", e.count).close('}');
}

}  // namespace gw
