// SPDX-License-Identifier: Apache-2.0
// Is one explanation better than another in many places, or in one? Signed ranks over independent blocks of unseen data:
// a glitch, an impact or one odd move counts as one block, however large its error.
#pragma once

#include <vector>

namespace driveid::diagnose {

// Wilcoxon's signed-rank statistic as a normal deviate: positive where `after` has the smaller squared errors. Blocks that did not
// change count for nothing.
double evidence(const std::vector<double> &before, const std::vector<double> &after);

// Share of the whole gain that is left when the tenth of the blocks that gained most is taken out.
double broad(const std::vector<double> &before, const std::vector<double> &after);

}  // namespace driveid::diagnose
