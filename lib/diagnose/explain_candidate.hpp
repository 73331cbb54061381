// SPDX-License-Identifier: Apache-2.0
// A candidate: one catalogue effect in one equation, with the grid of its shape parameters, and what it does to the equation.
#pragma once

#include <string>
#include <vector>

#include "diagnose/equation.hpp"

namespace driveid::diagnose {

struct ShapeAxis {
  double lo = 0, hi = 1;
  bool logarithmic = false, whole = false;
  std::vector<double> grid;
};

struct Candidate {
  const driveid_effect_info *info = nullptr;   // NULL for an own effect
  std::string name;
  std::string formula;                         // own effects
  std::vector<ShapeAxis> axis;
  int columns = 1;
  double speed = 0;                            // fastest in the record
  double trials = 1;                           // independent places that the search visits (orders, instants)
};

// What a candidate adds at given shapes: free columns, and a part that is known once the shapes are (taken off the target).
struct Term {
  Eigen::MatrixXd column;
  Eigen::VectorXd taken;                       // empty: nothing
  Eigen::VectorXd drive_part;                  // share of the drive that was removed from each column (empty: none)
  double drive_scale = 1;                      // share of the drive that a known part leaves
};
// Factor of the drive in a solution with this term; physical coefficients are the solution's divided by it.
double drive_factor(const Term &term, const Eigen::VectorXd &linear);

// Nominal values that some terms need (inertia and damping for the false acceleration of an eccentric encoder).
struct Nominal {
  double inertia = 0, damping = 0;
};

bool is(const Candidate &candidate, const char *effect);
std::vector<Candidate> make_candidates(const Equation &equation);
Candidate own_candidate(const driveid_effect_use &use, std::string &error);
Term realise(const Equation &equation, const Candidate &candidate, const std::vector<double> &shape, const Nominal &nominal);

// Published parameters from shapes and linear coefficients; base = coefficients of the nominal columns in the same solution.
std::vector<double> publish(const Equation &equation, const Candidate &candidate, const std::vector<double> &shape, const Eigen::VectorXd &linear);
bool lawful(const Equation &equation, const Candidate &candidate, const std::vector<double> &shape, const Eigen::VectorXd &linear, double inertia);
std::vector<double> shape_of(const Equation &equation, const Candidate &candidate, const std::vector<double> &published);
bool subsumes(const Candidate &a, const Candidate &b);

// Samples of the drive that a dead zone of this threshold is judged by.
int averaged_samples(const Equation &equation, double threshold);

// Load position behind spring, damper and (with gap > 0) clearance, driven by the measured motor position.
void load_position(const Track &track, double w, double zeta, double gap, std::vector<double> &x);

// Noise power that a solution with a second mass lets through, relative to the rigid one: a spring also filters the position's
// noise, and what that wins explains nothing. 1 for every other candidate.
double noise_ratio(const Equation &equation, const Candidate &candidate, const std::vector<double> &shape, const Eigen::VectorXd &linear, double inertia, double damping);

// The same spring seen from the drive: what is to be taken off the target when the input, not the motion, passes through it. A real
// spring explains both ways; a filter that only smooths the noise of one side does not.
// `losses`: what the motor loses before the spring, per track on the fine grid (empty: nothing).
Eigen::VectorXd spring_on_drive(const Equation &equation, double inertia, double load, double w, double zeta, const std::vector<std::vector<double>> &losses);

// A smaller equation made of stretches of a large one, for searches.
Equation thinned(const Equation &equation, std::size_t rows);

}  // namespace driveid::diagnose
