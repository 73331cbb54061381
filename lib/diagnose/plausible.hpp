// SPDX-License-Identifier: Apache-2.0
// Do a record and the values that a model brings along belong together? A swapped sign and a wrong unit show as the factor between
// the drive as logged and the drive that the model's own values make of the motion.
#pragma once

#include "diagnose/equation.hpp"

namespace driveid::diagnose {

std::vector<Notice> implausible(const EquationSet &set, const driveid_model &model, const std::string &record);

// Not empty: in this record the drive works against the acceleration; a sign is swapped.
std::string opposed(const EquationSet &set, const std::vector<Prepared> &training, const std::vector<Prepared> &held_out);

}  // namespace driveid::diagnose
