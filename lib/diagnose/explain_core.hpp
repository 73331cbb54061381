// SPDX-License-Identifier: Apache-2.0
// The questions in their order: is there anything removable? Who explains it? Is that the only one? What remains?
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "diagnose/explain_search.hpp"

namespace driveid::diagnose {

struct Remainder {                  // what general regressors find beyond a set of members
  double sse = 0;                   // cross-validated, with them
  double gain = 0;                  // log-likelihood, net of their cost
  double evidence = 0, broad = 0;   // over blocks (evidence.hpp)
  std::vector<int> family;          // in the order found
  std::vector<double> family_gain;
};

struct Structure {                  // error that a kernel's width of noise cannot make: it stays alike beyond the kernel's support
  double share = 0;                 // of the squared error, raw rows
  double power = 0;                 // its square, raw
  double evidence = 0;              // over blocks
};

struct Tie {
  int candidate = -1;
  std::vector<double> shape;
  double total = 0;
  std::string name;
};

struct Found {                      // one accepted effect (several members where it repeats: cogging of several orders)
  std::string name;
  std::vector<std::size_t> member;  // indices into Analysis::chosen
  double share = 0;                 // of the removable error, alone with the nominal model (held-out, or all blocks)
  double worth = 0, margin = 0;     // log-likelihood beyond its cost; lead over the best other explanation
  double confidence = 0;
  std::vector<Tie> ties;
  std::string rival;                // general family that does better in its place, though no effect of the catalogue is like it
  double behind = 0;                // share of what the family removes that the effect leaves
  double behind_evidence = 0;       // over blocks
};

struct Analysis {
  std::unique_ptr<Search> search;
  std::vector<Family> families;
  Floor floor;
  std::vector<Member> chosen;       // kept members of the user's model first
  std::vector<Option> offered;      // every candidate against the user's model alone
  std::vector<Found> found;
  Solution before, after;
  Remainder remainder;              // beyond chosen
  Remainder general;                // beyond the user's model alone
  Structure regular_before, regular_after;
  double removable = 0;             // whitened squared error that can go, at least
  double explained = 0;             // share of it that the accepted effects remove
  bool unknown = false;
  std::string outdone_by;           // the general family that does clearly better in an accepted effect's place
  double unknown_worth = 0;         // log-likelihood that something unknown holds
  std::vector<std::vector<Member>> steps;   // the set after each accepted step
};

struct Settings {
  int threads = 2;
  int most_effects = 3;
  std::vector<std::string> effects;             // only these, where not empty
  std::function<bool(double)> tick;             // 0..1; false cancels
};

Analysis analyse(Equation equation, const driveid_model &model, const Settings &settings, std::vector<Notice> &notices);
// Rows of a kind that this residual shows to be less sure count for less from now on; false where none is (explain_weight.cpp).
bool weigh_by_kind(Search &search, const Eigen::VectorXd &residual);
Structure structure_of(const Equation &equation, const Eigen::VectorXd &residual);
Remainder beyond(const Search &search, const std::vector<Family> &families, const std::vector<Member> &members);

}  // namespace driveid::diagnose
