// SPDX-License-Identifier: Apache-2.0
// Noise floor of an equation: bracketed below by sensor noise and quantisation sent through the kernel, above by what a
// cross-validated flexible regression cannot predict.
#pragma once

#include "diagnose/equation.hpp"

namespace driveid::diagnose {

// A family of general regressors that names no physics ("force over position", "inertia over position", "drag over speed" ...).
struct Family {
  std::string name;                      // short fixed word
  std::vector<std::string> coordinates;  // in which it is regular: {"omega_rad_s"}
  std::vector<std::string> catalogue;    // effects whose shape lies inside this family
  Eigen::MatrixXd column;                // raw rows
};

struct Floor {
  double lo = 0, hi = 0;                 // RMS, unit of the equation, on raw rows of the held-out part (or all)
  Eigen::VectorXd flexible;              // cross-validated prediction of what the base leaves, raw rows
  double removable = 0;                  // whitened: share of the nominal squared error that the flexible regression removes on unseen blocks
};

std::vector<Family> make_families(const Equation &equation);
Floor find_floor(Equation &equation, const std::vector<Family> &families);   // also fits the whitening of the equation

}  // namespace driveid::diagnose
