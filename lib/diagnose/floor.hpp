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

// Sums of products of whitened columns, block by block, from which any subset is cross-validated at no further cost.
class BlockGram {
 public:
  BlockGram(const Equation &equation, const Eigen::MatrixXd &whitened, const Eigen::VectorXd &whitened_y);
  struct Score {
    std::vector<double> sse, rows;     // by block, each predicted from the other folds
    double total = 0, held = 0;        // over all blocks; over the held-out blocks, predicted from the training blocks alone
    double held_rows = 0;
  };
  // ridge: relative to the mean square of each column
  Score cross_validate(const std::vector<int> &columns, const std::vector<double> &ridge) const;
  Eigen::VectorXd solve(const std::vector<int> &columns, const std::vector<double> &ridge, bool training_only) const;

 private:
  Eigen::VectorXd solve_without(const std::vector<int> &columns, const std::vector<double> &ridge, int fold, bool training_only) const;
  double block_sse(int block, const std::vector<int> &columns, const Eigen::VectorXd &p) const;
  std::vector<Eigen::MatrixXd> gram_, fold_gram_;
  std::vector<Eigen::VectorXd> xy_, fold_xy_;
  std::vector<int> fold_;
  std::vector<double> yy_, rows_;
  std::vector<unsigned char> held_;
  Eigen::MatrixXd all_, training_;
  Eigen::VectorXd all_xy_, training_xy_;
};

struct Floor {
  double lo = 0, hi = 0;                 // RMS, unit of the equation, on raw rows of the held-out part (or all)
  Eigen::VectorXd flexible;              // cross-validated prediction of what the base leaves, raw rows
  double nominal_sse = 0, flexible_sse = 0;       // whitened, cross-validated, all blocks
  std::vector<double> nominal_block, flexible_block;
  double rows = 0;                       // whitened rows that count
};

std::vector<Family> make_families(const Equation &equation);
Family order_family(const Equation &equation, double order);   // a wave of one order whose size depends on speed
Floor find_floor(Equation &equation, const std::vector<Family> &families);   // also fits the whitening of the equation

}  // namespace driveid::diagnose
