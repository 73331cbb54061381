// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <fstream>
#include <iostream>

#include <CLI/CLI.hpp>

#include <driveid/version.h>

#include "daemon.hpp"
#include "sink/make_sink.hpp"

namespace {

constexpr int kUsage = 2;

struct Silent final : gw::DriveListener {
    void on_sample(int, const driveid_sample&) override {}
    void on_report(int) override {}
};

int print_errors(const std::vector<std::string>& errors) {
    for (const auto& e : errors) std::cerr << e << "\n";
    return kUsage;
}

// Reads, checks, and builds every drive aside.
bool prepare(const std::string& file, gw::Config& config, std::vector<std::unique_ptr<gw::Drive>>& drives, std::vector<std::string>& errors) {
    static Silent silent;
    gw::ConfigResult result = gw::config_read_file(file);
    errors = result.errors;
    config = std::move(result.config);
    if (!errors.empty()) return false;
    drives = gw::build_drives(config, silent, errors);
    if (errors.empty()) gw::check_transmit(config, drives, errors);
    return errors.empty();
}

int write_map(const std::string& path, const std::string& text) {
    if (path == "-") {
        std::cout << text;
        return 0;
    }
    std::ofstream out(path, std::ios::binary);
    out << text;
    out.close();
    if (!out) return print_errors({path + ": cannot be written; check folder and permissions"});
    return 0;
}

void override_replay(gw::Config& config, const std::string& record, double speed) {
    for (auto& s : config.sources) {
        s.kind = "replay";
        s.file = std::filesystem::absolute(record).string();
        s.speed = speed;
    }
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("driveidd: identifies electric drives on a bus while they run");
    app.set_version_flag("--version", "driveidd " DRIVEID_VERSION);
    std::string file, check, dbc, registers, replay;
    double speed = 0;
    bool manual = false;
    gw::RunOptions options;
    app.add_option("config,-c,--config", file, "configuration (TOML)");
    app.add_option("--check", check, "say what is wrong with this configuration, and stop");
    app.add_flag("--manual", manual, "print the manual page of the configuration (Markdown)");
    app.add_option("--dbc", dbc, "write the DBC of the frames that are sent (- standard output), and stop");
    app.add_option("--registers", registers, "write the table of Modbus registers as CSV (- standard output), and stop");
    app.add_option("--replay", replay, "replay this record (.drec or candump .log) in place of all sources");
    app.add_option("--speed", speed, "pace of --replay: 1 original, 0 as fast as possible")->check(CLI::Range(0.0, 1e6));
    app.add_flag("--exit-at-end", options.exit_at_end, "stop when all replays have ended");
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& e) {
        return app.exit(e) == 0 ? 0 : kUsage;
    }
    if (manual) {
        std::cout << gw::config_manual();
        return 0;
    }
    if (!check.empty()) file = check;
    if (file.empty()) return print_errors({"driveidd: no configuration; driveidd FILE, or driveidd --help"});

    gw::Config config;
    std::vector<std::unique_ptr<gw::Drive>> drives;
    std::vector<std::string> errors;
    if (!prepare(file, config, drives, errors)) return print_errors(errors);
    if (!check.empty()) {
        std::cout << file << ": fine (" << config.sources.size() << " sources, " << config.drives.size() << " drives, " << config.sinks.size() << " sinks)\n";
        for (auto& d : drives)
            if (*d->online().missing) std::cout << file << ": drive \"" << d->config().name << "\": " << d->online().missing << "\n";
        return 0;
    }
    if (!dbc.empty()) return write_map(dbc, gw::signal_map_dbc(config, drives));
    if (!registers.empty()) return write_map(registers, gw::signal_map_registers(config, drives));
    drives.clear();
    if (!replay.empty()) override_replay(config, replay, speed);
    static const char* const levels[] = {"debug", "info", "warning", "error"};
    for (int k = 0; k < 4; ++k)
        if (config.system.log_level == levels[k]) gw::log_level(gw::Level(k));
    gw::block_signals();
    try {
        return gw::Daemon(std::move(config), options).run();
    } catch (const std::exception& e) {
        return print_errors({std::string("driveidd: ") + e.what()});
    }
}
