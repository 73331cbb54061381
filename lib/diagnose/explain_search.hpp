// SPDX-License-Identifier: Apache-2.0
// Search of one equation: which effects, at which shapes, does the record ask for?
// Shapes are searched on stretches, refined on everything; every decision is taken on blocks that the fit has not seen.
#pragma once

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "diagnose/explain_candidate.hpp"
#include "diagnose/floor.hpp"

namespace driveid::diagnose {

struct Member {
  int candidate = -1;
  std::vector<double> shape;
  bool kept = false;          // stands in the user's model: never dropped
};

// What adding a candidate to a set of members would bring.
struct Option {
  int candidate = -1;
  std::vector<double> shape;
  bool possible = false;      // lawful parameters, regressor not inside the span of the others
  double gain = 0;            // log-likelihood gained on unseen blocks, against the set it was offered to
  double cost = 0;            // what that gain must pay for: columns, shapes, places looked at
  double relative = 0;        // share of the squared error that goes
  double evidence = 0;        // over blocks (evidence.hpp)
  double broad = 0;           // share of the gain left without the best tenth of the blocks
  double consistency = 0;     // over stretches, weighed by what the effect says there (evidence.hpp)
  double check = -1;          // spring: share of the error left when it is seen from the drive; negative: not asked
  double unchecked = 0;       // total before that
  double relative_raw = 0;    // the same share before whitening: what a user sees fall
  double held_gain = 0;       // log-likelihood gained on held-out blocks by a fit to the training blocks alone
  double held_share = 0;      // share of the rows that are held out: what held_gain should be of gain
  std::vector<double> sse;    // by block
  double total = 0;
  double raw = 0;             // squared error before whitening
  double noise = 1;           // noise power let through, relative to the nominal model: already divided out of the errors
  // Held-out data decides: what was gained counts only as far as unseen blocks confirm a third of it.
  double worth() const { return (held_share > 0 ? std::min(gain, 3 * held_gain / held_share) : gain) - cost; }
};

struct Solution {
  std::vector<Member> member;
  BlockGram::Score score;
  Eigen::VectorXd coefficient;               // free nominal columns, then the members' columns in order (fit to all blocks)
  std::vector<Eigen::VectorXd> linear;       // by member
  Eigen::VectorXd residual;                  // raw rows
  Eigen::VectorXd white;                     // whitened residual
};

void put_beside(Eigen::MatrixXd &a, const Eigen::MatrixXd &b);   // b as further columns of a

class Search {
 public:
  Search(Equation equation, std::vector<Candidate> candidates, int threads);
  const Equation &equation() const { return full_; }
  const std::vector<Candidate> &candidates() const { return candidates_; }
  // Every candidate offered to a set; index = candidate. A candidate replaces the members that it contains.
  std::vector<Option> offer(const std::vector<Member> &members, const std::vector<int> &skip = {});
  Option refine(int candidate, const std::vector<Member> &members, const std::vector<double> &from);
  Solution solve(const std::vector<Member> &members) const;
  std::vector<Member> joined(const std::vector<Member> &members, int candidate, const std::vector<double> &shape) const;
  // Are the values of every free member physical when all are solved together?
  bool sound(const std::vector<Member> &members) const;
  // Re-optimises the shapes of all free members together, one after another.
  void polish(std::vector<Member> &members);
  double rows() const { return rows_; }
  void weigh(std::vector<double> weight);   // of whitened rows: relative, 0 leaves a row out
  // 95 % covariance of (coefficients, shapes) of a solution, by blocks of correlated rows.
  Eigen::MatrixXd covariance(const Solution &solution) const;
  const Nominal &nominal() const { return nominal_; }
  double inertia(const Solution &solution) const;
  void set_progress(std::function<bool(double)> tick) { tick_ = std::move(tick); }
  bool cancelled() const { return cancelled_; }

 private:
  struct View {                // an equation with the members' columns projected out
    const Equation *equation;
    Eigen::MatrixXd z;
    Eigen::LDLT<Eigen::MatrixXd> factor;
    Eigen::VectorXd scale, y, r, zy;
    double rr;
  };
  struct Context {
    std::vector<Member> members;
    View thin, full;
    BlockGram::Score score;
    double raw = 0;
  };
  // Squared error of whitened residuals brought back to raw rows.
  double raw_square(const Eigen::VectorXd &white) const;
  View view(const Equation &equation, const std::vector<Member> &members) const;
  double left(const View &view, const Candidate &candidate, const std::vector<double> &shape) const;   // pooled squared error
  Option try_candidate(int candidate, const Context &context, const Context &against, const std::vector<std::vector<double>> &seeds) const;
  void refine_shape(const View &view, const Candidate &candidate, std::vector<double> &shape, double &best, int rounds) const;
  Option judged(int candidate, const Context &context, const std::vector<double> &shape, const Context &against) const;
  Context context(const std::vector<Member> &members) const;
  std::vector<std::vector<double>> losses(const std::vector<Member> &members, const Eigen::VectorXd &coefficient) const;
  bool less_above_threshold(const std::vector<Member> &members, int candidate, const std::vector<double> &shape, double share) const;
  double seen_from_drive(const Context &context, const std::vector<double> &shape, const Eigen::VectorXd &coefficient) const;

  Equation full_, thin_;
  std::vector<Candidate> candidates_;
  Nominal nominal_;
  std::vector<std::vector<double>> known_;   // best shape seen so far, by candidate
  double rows_ = 0;
  int threads_;
  std::function<bool(double)> tick_;
  bool cancelled_ = false;
};

}  // namespace driveid::diagnose
