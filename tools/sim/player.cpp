// SPDX-License-Identifier: Apache-2.0
#include "player.hpp"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "case.hpp"
#include "effects.hpp"
#include "logger.hpp"

namespace sim {
namespace {

using json = nlohmann::ordered_json;

std::int64_t now_ns(clockid_t clock) {
    timespec t{};
    clock_gettime(clock, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}

void sleep_until(std::int64_t t_ns) {
    const timespec t{static_cast<time_t>(t_ns / 1000000000), static_cast<long>(t_ns % 1000000000)};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr);
}

json phase_of(double t_s, const Setup &s, const std::vector<std::string> &effects, const char *what) {
    json out = json::parse(drive_json(s, effects));
    out.erase("seed");
    json phase = {{"t_s", t_s}, {"what", what}};
    phase.update(out);
    return phase;
}

struct Event { double t_s; const char *what; };

// What will change, in order of time.
std::vector<Event> events_of(const PlayRequest &q) {
    std::vector<Event> out;
    if (q.load_change_at_s >= 0) out.push_back({q.load_change_at_s, "load change"});
    if (q.friction_change_at_s >= 0) out.push_back({q.friction_change_at_s, "friction change"});
    if (q.effect_at_s >= 0 && !q.effect.empty()) out.push_back({q.effect_at_s, "effect"});
    std::stable_sort(out.begin(), out.end(), [](const Event &a, const Event &b) { return a.t_s < b.t_s; });
    return out;
}

void apply(const Event &e, const PlayRequest &q, const Drive &rated, Setup &s) {
    const std::string what = e.what;
    if (what == "load change") s.drive.J *= q.load_factor;
    else if (what == "friction change") { s.drive.B *= q.friction_factor; s.drive.coulomb *= q.friction_factor; }
    else add_effect(q.effect, q.effect_size, rated, 60, q.seed, s.hidden);
}

json timeline(const PlayRequest &q, const Setup &setup) {
    json phases = json::array({phase_of(0, setup, {}, "start")});
    Setup s = setup;
    std::vector<std::string> effects;
    for (const auto &e : events_of(q)) {
        apply(e, q, setup.drive, s);
        if (std::string(e.what) == "effect") effects.push_back(q.effect);
        phases.push_back(phase_of(e.t_s, s, effects, e.what));
    }
    return phases;
}

void describe(const PlayRequest &q, const Setup &setup, const std::vector<FrameLayout> &layout) {
    if (!q.dbc_file.empty()) write_text(q.dbc_file, dbc_text(layout));
    if (q.config_file.empty()) return;
    ConfigOptions c = q.config;
    c.structure = q.structure;
    c.given = given_parameters(setup);
    if (q.structure == "rigid_axis" || q.structure == "dc_drive") c.given["K_t_Nm_A"] = setup.drive.K_t;
    c.dt_s = 1 / q.rate_Hz;
    c.fd = q.layout.fd;
    const auto colon = q.bus.find(':');
    const std::string kind = q.bus.substr(0, colon), rest = colon == std::string::npos ? "" : q.bus.substr(colon + 1);
    if (kind == "modbus") {
        const auto port = rest.rfind(':');
        write_text(q.config_file, modbus_config(setup, c, rest.substr(0, port), std::stoi(rest.substr(port + 1))));
        return;
    }
    c.source_kind = kind == "can" ? "socketcan" : kind == "log" ? "replay" : "socketpair";
    c.address = kind == "log" ? std::filesystem::absolute(rest).string() : rest;
    write_text(q.config_file, config_text(layout, c));
}

}  // namespace

std::uint64_t play(const PlayRequest &q, const volatile std::sig_atomic_t *stop) {
    CaseRequest draw;
    draw.seed = q.seed; draw.structure = q.structure; draw.rate_Hz = q.rate_Hz; draw.known_coulomb = q.known_coulomb;
    draw.effects = {q.effect.empty() ? "none" : q.effect};
    Setup setup = draw_setup(draw);
    setup.open_loop = false;
    setup.program = q.program;
    setup.noise = q.noise;
    setup.inject_d = q.inject_d * setup.drive.I_rated;
    if (q.average || q.instant) setup.sensors.average = q.average;
    setup.sensors.has_i = true; setup.sensors.has_tau = false; setup.sensors.current_is_q = true; setup.sensors.dirt.clear();
    if (!q.effect.empty() && !find_effect(q.effect)) throw std::runtime_error("unknown effect '" + q.effect + "': `driveid-sim effects` lists them");
    const auto layout = default_layout(setup, q.layout);
    describe(q, setup, layout);
    const auto bus = open_bus(q, setup);
    const std::int64_t start = now_ns(CLOCK_MONOTONIC), wall = now_ns(CLOCK_REALTIME);
    if (!q.truth_file.empty()) {
        json truth = {{"seed", q.seed}, {"rate_Hz", q.rate_Hz}, {"start_monotonic_ns", start}, {"start_realtime_ns", wall}, {"phases", timeline(q, setup)}};
        write_text(q.truth_file, truth.dump(2) + "\n");
    }

    Run run(setup, 0);
    Random luck(q.seed, "bus");
    Setup now = setup;
    const auto events = events_of(q);
    std::size_t happened = 0;
    std::vector<Reading> readings;
    const auto rows = q.duration_s > 0 ? static_cast<std::uint64_t>(q.duration_s * q.rate_Hz) : UINT64_MAX;
    const bool paced = bus->real_time() && q.speed > 0;
    std::uint64_t sent = 0;
    std::vector<Frame> frames;
    for (std::uint64_t n = 0; n < rows && !*stop; ++n) {
        const Truth x = run.advance();
        const Reading r = run.read(x);
        for (; happened < events.size() && x.t >= events[happened].t_s; ++happened) {
            apply(events[happened], q, setup.drive, now);
            run.plant().set_drive(now.drive);
            run.plant().set_hidden(now.hidden);
        }
        if (!q.csv_file.empty()) readings.push_back(r);
        frames.clear();
        std::int64_t lag = 0;
        for (const auto &f : layout) {
            lag += 120000;  // about a frame's time on the wire at 1 Mbit/s
            if (q.loss > 0 && luck.chance(q.loss)) continue;
            Frame frame = encode(f, r, static_cast<std::uint32_t>(n));
            frame.t_ns = (bus->real_time() ? start : wall) + std::llround(x.t * 1e9) + lag + std::llround(q.jitter_s * 1e9 * luck.uniform());
            frames.push_back(frame);
        }
        if (paced) sleep_until(start + std::llround(x.t / q.speed * 1e9));
        if (bus->send(frames, r, static_cast<std::uint32_t>(n))) sent += frames.size();
    }
    if (!q.csv_file.empty()) write_record(setup, readings, 0, q.csv_file);
    return sent;
}

}  // namespace sim
