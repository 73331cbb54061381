// SPDX-License-Identifier: Apache-2.0
// Errors of a model on a record, in the equation and in simulation, each next to its noise floor, and tests of what is left.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "diagnose/equation.hpp"
#include "diagnose/fit_core.hpp"

namespace driveid::diagnose {

struct ErrorObject {
  double rmse = -1;                    // negative: could not be had
  std::string unit, signal;
  double floor_lo = 0, floor_hi = 0;
  double fit_percent = 0;              // 100 (1 - rmse / spread of the measured signal)
};

struct ErrorSet { ErrorObject equation, one_step, windows, free_run; };

struct ResidualTest {
  std::string name;                    // "whiteness", "independence of i_A", ...
  double statistic = 0, bound = 0;
  bool passed = true;
};

struct Compared {
  ErrorSet errors;
  std::vector<ResidualTest> tests;
  std::vector<Notice> notices;
  nlohmann::ordered_json where = nlohmann::ordered_json::array();   // regimes by their share of the removable error, as explain gives them
};

// Residual of an equation with the model's own values, raw rows (the parameters are not fitted again).
Eigen::VectorXd equation_residual(const Equation &equation, const driveid_model &model);

// record: one of those behind set. The simulation part alone where quick.
// quick: the free run alone; floor_share: how much of the equation's error is floor, which is not looked for then.
Compared compare_record(const driveid_model &model, const Prepared &record, bool quick = false, double floor_share = 1);

// Free run over several records, for the error sets of explain and improve. equation: their own balance, whose share of floor the free run takes.
nlohmann::ordered_json simulated_errors(const driveid_model &model, const std::vector<Prepared> &records, const nlohmann::ordered_json &equation);
std::vector<ResidualTest> residual_tests(const Equation &equation, const Eigen::VectorXd &residual);

nlohmann::ordered_json to_json(const ErrorObject &error);
nlohmann::ordered_json to_json(const ErrorSet &errors);

// Mean of several records' sets, weighted by rows (training or held-out side as a whole).
ErrorSet together(const std::vector<ErrorSet> &sets, const std::vector<double> &rows);

}  // namespace driveid::diagnose
