// SPDX-License-Identifier: Apache-2.0
// Hidden effects by name: each fills fields of Hidden at a given size. Shapes (orders, phases, knees) come from the seed and
// stay the same while the size changes.
#pragma once
#include <string>
#include <utility>
#include <vector>

#include "drive.hpp"

namespace sim {

struct EffectEntry {
    const char *name;
    bool catalogue;          // false: outside the catalogue, must be called unknown
    const char *structures;  // space-separated structures in which it can be hidden
    double largest;          // size at which it stops being realistic
    bool electrical;         // its error stands in the voltage equation
};

const std::vector<EffectEntry> &effect_table();
const EffectEntry *find_effect(const std::string &name);

// Adds an effect of a size (1 is about the largest a maintained machine shows) to hidden. Throws std::invalid_argument for an unknown name.
void add_effect(const std::string &name, double size, const Drive &drive, double record_s, std::uint64_t seed, Hidden &hidden);

// True parameters of the effect in the published symbols, SI, for the truth file. Those that scale with the torque are marked:
// whoever is given a wrong K_t, or none, sees them scaled.
struct TrueParameter { std::string name; double value; bool torque; };
std::vector<TrueParameter> effect_parameters(const std::string &name, const Drive &drive, const Hidden &hidden);

}  // namespace sim
