// SPDX-License-Identifier: Apache-2.0
// driveid-sim: the drive simulator's command line.
#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <memory>

#include "case.hpp"
#include "csv_frames.hpp"
#include "effects.hpp"
#include "player.hpp"

namespace {

volatile std::sig_atomic_t stop_asked = 0;
void ask_stop(int) { stop_asked = 1; }

const std::vector<std::string> STRUCTURES = {"rigid_axis", "linear_axis", "dc_drive", "dc_circuit", "pmsm_drive"};

void add_case(CLI::App &app) {
    auto q = std::make_shared<sim::CaseRequest>();  // the callback keeps what the options refer to
    auto folder = std::make_shared<std::string>("."), truth = std::make_shared<std::string>();
    auto effects = std::make_shared<std::vector<std::string>>();
    auto *command = app.add_subcommand("case", "one drive with a hidden effect: train.csv, held_out.csv, case.json, and the truth elsewhere");
    command->add_option("--seed", q->seed, "drive, motion, noise and dirt are drawn from it")->capture_default_str();
    command->add_option("--structure", q->structure, "rigid_axis linear_axis dc_drive dc_circuit pmsm_drive")
        ->check(CLI::IsMember(STRUCTURES))->capture_default_str();
    command->add_option("--effect", *effects, "hidden effect; twice for a pair; none for a complete model")->take_all();
    command->add_option("--size", q->ratio, "nominal error over noise floor (10, 3, 1.2, 1.05, 1.01)")->check(CLI::Range(1.0, 100.0))->capture_default_str();
    command->add_option("--raw-size", q->raw_size, "effect size itself instead of --size; 1 is large")->check(CLI::NonNegativeNumber);
    command->add_option("--dirt", q->dirt, "none, auto, or words: dropped lag jitter glitch wrap k_t")->capture_default_str();
    command->add_option("--train-s", q->train_s, "length of the training record, s")->check(CLI::Range(2.0, 36000.0))->capture_default_str();
    command->add_option("--held-out-s", q->held_out_s, "length of the held-out record, s")->check(CLI::Range(2.0, 36000.0))->capture_default_str();
    command->add_option("--rate", q->rate_Hz, "log rate, Hz (default: drawn from 250 to 4000)")->check(CLI::IsMember({"250", "500", "1000", "2000", "4000"}));
    command->add_flag("--known-coulomb", q->known_coulomb, "the drive has Coulomb friction and the model under test knows it");
    command->add_flag("--draw-known-coulomb", q->draw_known_coulomb, "as --known-coulomb, in about a third of the seeds");
    command->add_option("--out", *folder, "folder for the records")->required();
    command->add_option("--truth", *truth, "file for the truth (default OUT/../truth-NAME.json)");
    command->callback([=] {
        q->effects = effects->empty() ? std::vector<std::string>{"none"} : *effects;
        namespace fs = std::filesystem;
        fs::create_directories(*folder);
        const fs::path out = fs::absolute(*folder).lexically_normal();
        const std::string name = out.filename().empty() ? out.parent_path().filename().string() : out.filename().string();
        const fs::path parent = out.filename().empty() ? out.parent_path().parent_path() : out.parent_path();
        sim::write_case(*q, *folder, truth->empty() ? (parent / ("truth-" + name + ".json")).string() : *truth);
    });
}

void add_run(CLI::App &app) {
    auto q = std::make_shared<sim::PlayRequest>();
    auto *command = app.add_subcommand("run", "a drive that plays in real time on a bus, or into a candump log");
    command->add_option("--bus", q->bus, "can:IFACE | modbus:HOST:PORT | fd:N (inherited datagram socket) | log:FILE.log")->required();
    command->add_option("--seed", q->seed, "the drive and its motion are drawn from it")->capture_default_str();
    command->add_option("--structure", q->structure, "rigid_axis linear_axis dc_drive dc_circuit pmsm_drive")->check(CLI::IsMember(STRUCTURES))->capture_default_str();
    command->add_option("--program", q->program, "mixed p2p jog rest reversal prbs chirp slow steady")
        ->check(CLI::IsMember({"mixed", "p2p", "jog", "rest", "reversal", "prbs", "chirp", "slow", "steady"}))->capture_default_str();
    command->add_option("--rate", q->rate_Hz, "samples per second")->check(CLI::IsMember({"250", "500", "1000", "2000", "4000"}))->capture_default_str();
    command->add_option("--duration", q->duration_s, "s; 0: until stopped (SIGINT, SIGTERM)")->check(CLI::Range(0.0, 1e7))->capture_default_str();
    command->add_option("--speed", q->speed, "times real time; 0: as fast as possible (a log always is)")->check(CLI::Range(0.0, 1000.0))->capture_default_str();
    command->add_option("--load-change-at", q->load_change_at_s, "s after the start");
    command->add_option("--factor", q->load_factor, "inertia after the load change over that before")->check(CLI::Range(0.05, 20.0))->capture_default_str();
    command->add_option("--friction-change-at", q->friction_change_at_s, "s after the start");
    command->add_option("--friction-factor", q->friction_factor, "viscous and Coulomb friction after the change over that before")->check(CLI::Range(0.05, 20.0))->capture_default_str();
    command->add_option("--effect", q->effect, "hidden effect that is switched on");
    command->add_option("--effect-at", q->effect_at_s, "s after the start at which it is switched on");
    command->add_option("--size", q->effect_size, "its size; 1 is large (cogging: 6 % of rated torque; delay: 6 ms)")->check(CLI::Range(0.0, 10.0))->capture_default_str();
    command->add_flag("--known-coulomb", q->known_coulomb, "the drive has Coulomb friction from the start");
    auto *average = command->add_flag("--average", q->average, "currents are means over the sample (default: drawn)");
    command->add_flag("--instant", q->instant, "currents are taken at the instant")->excludes(average);
    command->add_option("--noise", q->noise, "times the drawn sensor noise")->check(CLI::Range(0.0, 100.0))->capture_default_str();
    command->add_option("--inject-d", q->inject_d, "PMSM: square wave on the d current, share of rated")->check(CLI::Range(0.0, 1.0))->capture_default_str();
    command->add_option("--loss", q->loss, "share of frames lost")->check(CLI::Range(0.0, 1.0))->capture_default_str();
    command->add_option("--jitter", q->jitter_s, "jitter of the frames' stamps, s")->check(CLI::Range(0.0, 1.0))->capture_default_str();
    command->add_flag("--fd", q->layout.fd, "CAN FD: all signals in one frame");
    command->add_flag("--big-endian", q->layout.big_endian, "Motorola byte order");
    command->add_option("--can-id", q->layout.id, "identifier of the first frame")->check(CLI::Range(1u, 0x1FFFFFFFu))->capture_default_str();
    command->add_option("--truth", q->truth_file, "write the true parameters over time (JSON)");
    command->add_option("--config", q->config_file, "write a configuration for driveidd");
    command->add_option("--dbc", q->dbc_file, "write the DBC of the frames");
    command->add_option("--csv", q->csv_file, "write the samples sent (CSV)");
    command->add_option("--socket", q->config.socket, "control socket in the configuration")->capture_default_str();
    command->add_option("--model", q->config.model, "model file in the configuration, instead of structure and given");
    command->add_option("--drive", q->config.drive, "drive's name in the configuration")->capture_default_str();
    command->add_option("--record-folder", q->config.record_folder, "record folder in the configuration");
    command->callback([=] {
        if (q->bus.rfind("log:", 0) == 0 && q->duration_s <= 0) throw CLI::ValidationError("--duration", "a log needs a length");
        if (!q->effect.empty() && q->effect_at_s < 0) q->effect_at_s = 0;
        std::signal(SIGINT, ask_stop);
        std::signal(SIGTERM, ask_stop);
        std::fprintf(stderr, "driveid-sim: seed %llu, %s at %g Hz on %s\n", static_cast<unsigned long long>(q->seed), q->structure.c_str(), q->rate_Hz, q->bus.c_str());
        const auto sent = sim::play(*q, &stop_asked);
        std::fprintf(stderr, "driveid-sim: %llu frames\n", static_cast<unsigned long long>(sent));
    });
}

void add_frames(CLI::App &app) {
    auto q = std::make_shared<sim::CsvFramesRequest>();
    auto given = std::make_shared<std::vector<std::string>>();
    auto *command = app.add_subcommand("frames", "turn a CSV record into candump frames, with a DBC and a configuration");
    command->add_option("csv", q->csv, "record with t_s or t_ns")->required()->check(CLI::ExistingFile);
    command->add_option("--map", q->map, "NAME=COLUMN[:FACTOR], e.g. F_N=force_N")->take_all();
    command->add_option("--structure", q->options.structure, "structure of the drive")->required();
    command->add_option("--given", *given, "NAME=VALUE for the configuration")->take_all();
    command->add_option("--log", q->log, "candump log to write")->required();
    command->add_option("--dbc", q->dbc, "DBC to write");
    command->add_option("--config", q->config, "configuration for driveidd to write");
    command->add_option("--interface", q->interface, "name in the log")->capture_default_str();
    command->add_flag("--live", [q](std::int64_t) { q->replay = false; }, "the configuration listens to the interface instead of replaying the log");
    command->add_option("--socket", q->options.socket, "control socket in the configuration")->capture_default_str();
    command->add_option("--model", q->options.model, "model file in the configuration");
    command->add_option("--drive", q->options.drive, "drive's name")->capture_default_str();
    command->add_option("--can-id", q->id, "first identifier")->capture_default_str();
    command->add_flag("--fd", q->fd, "CAN FD");
    command->add_flag("--big-endian", q->big_endian, "Motorola byte order");
    command->callback([=] {
        for (const auto &g : *given) {
            const auto equal = g.find('=');
            if (equal == std::string::npos) throw CLI::ValidationError("--given", g + ": write NAME=VALUE");
            q->options.given[g.substr(0, equal)] = std::stod(g.substr(equal + 1));
        }
        std::fprintf(stderr, "driveid-sim: %zu samples written to %s\n", sim::csv_to_frames(*q), q->log.c_str());
    });
}

void add_effects(CLI::App &app) {
    app.add_subcommand("effects", "list what can be hidden, and in which structures")->callback([] {
        for (const auto &e : sim::effect_table())
            std::printf("%-26s %-22s %s\n", e.name, e.catalogue ? "catalogue" : "outside the catalogue", e.structures);
    });
}

}  // namespace

int main(int argc, char **argv) {
    CLI::App app{"driveid-sim: a simulated drive with known truth, as records, as bus frames, or live on a bus"};
    app.require_subcommand(1);
    add_case(app);
    add_run(app);
    add_frames(app);
    add_effects(app);
    if (argc > 1 && argv[1][0] != '-' && !app.get_subcommands([argv](const CLI::App *a) { return a->get_name() == argv[1]; }).size()) {
        std::fprintf(stderr, "driveid-sim: unknown command '%s'; there are: case, run, frames, effects\n", argv[1]);
        return 2;
    }
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError &e) {
        return app.exit(e) == 0 ? 0 : 2;
    } catch (const std::exception &e) {
        std::fprintf(stderr, "driveid-sim: %s\n", e.what());
        return 2;
    }
    return 0;
}
