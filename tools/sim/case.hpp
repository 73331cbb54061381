// SPDX-License-Identifier: Apache-2.0
// A case: one drawn drive with a hidden effect, a training and a held-out record, and its truth in a separate place.
#pragma once
#include <string>
#include <vector>

#include "calibrate.hpp"
#include "run.hpp"

namespace sim {

struct CaseRequest {
    std::uint64_t seed = 1;
    std::string structure = "rigid_axis";
    std::vector<std::string> effects;   // one or two names; empty or "none": nothing hidden
    double ratio = 3;                   // nominal error over noise floor
    double raw_size = -1;               // >= 0: effect size itself instead of a ratio
    std::string dirt = "none";          // none | auto | words of Sensors::dirt
    double train_s = 20, held_out_s = 12;
    double rate_Hz = 0;                 // 0: drawn
    bool known_coulomb = false;         // the model under test knows Coulomb friction
    bool draw_known_coulomb = false;
};

Setup draw_setup(const CaseRequest &request);

// Writes DIR/train.csv, DIR/held_out.csv, DIR/case.json (what the user knows) and TRUTH (what is hidden).
void write_case(const CaseRequest &request, const std::string &folder, const std::string &truth_file);

std::string drive_json(const Setup &setup, const std::vector<std::string> &effects);

}  // namespace sim
