// SPDX-License-Identifier: Apache-2.0
// driveid-sim: the drive simulator's command line.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <filesystem>

#include "case.hpp"
#include "effects.hpp"

namespace {

void add_case(CLI::App &app) {
    auto *q = new sim::CaseRequest;  // lives as long as the program
    auto *folder = new std::string("."), *truth = new std::string;
    auto *effects = new std::vector<std::string>;
    auto *command = app.add_subcommand("case", "one drive with a hidden effect: train.csv, held_out.csv, case.json, and the truth elsewhere");
    command->add_option("--seed", q->seed, "drive, motion, noise and dirt are drawn from it")->capture_default_str();
    command->add_option("--structure", q->structure, "rigid_axis linear_axis dc_drive dc_circuit pmsm_drive")
        ->check(CLI::IsMember({"rigid_axis", "linear_axis", "dc_drive", "dc_circuit", "pmsm_drive"}))->capture_default_str();
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
    add_effects(app);
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
