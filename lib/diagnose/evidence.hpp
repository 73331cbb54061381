// SPDX-License-Identifier: Apache-2.0
// Is one explanation better than another in many places, or in one? Signed ranks over independent blocks of unseen data:
// a glitch, an impact or one odd move counts as one block, however large its error.
#pragma once

#include <vector>

#include <Eigen/Dense>

namespace driveid::diagnose {

// Wilcoxon's signed-rank statistic as a normal deviate: positive where `after` has the smaller squared errors. Blocks that did not
// change count for nothing.
double evidence(const std::vector<double> &before, const std::vector<double> &after);

// Share of the whole gain that is left when the tenth of the blocks that gained most is taken out.
double broad(const std::vector<double> &before, const std::vector<double> &after);

// Score test of an explanation from whitened residuals without and with it, studentised over stretches of rows: where the explanation
// says nothing it weighs nothing, and one stretch alone, however large its error, brings at most 1.
double consistency(const Eigen::VectorXd &before, const Eigen::VectorXd &after, Eigen::Index stretch = 60);

}  // namespace driveid::diagnose
