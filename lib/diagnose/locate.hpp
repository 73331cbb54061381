// SPDX-License-Identifier: Apache-2.0
// Where a model fails: its residual resolved over speed, direction, reversals, acceleration, position in the turn, current,
// temperature, time and frequency, each regime with a test, so that chance is not called a cause.
#pragma once

#include <string>
#include <vector>

#include "diagnose/equation.hpp"

namespace driveid::diagnose {

struct Regime {
  std::string axis, text;      // "speed", "|omega| below 3.2 rad/s"
  double lo = 0, hi = 0;       // bounds on the axis, where it has some
  double share = 0;            // of the removable squared error
  double rows = 0;             // share of the rows
  double statistic = 0, bound = 0;   // error inside against outside, over stretches; bound with all regimes counted
  bool significant = false;
};

// residual: of the model; floor: what the best prediction leaves (same rows). Ranked by share.
std::vector<Regime> locate(const Equation &equation, const Eigen::VectorXd &residual, const Eigen::VectorXd &floor);

// Orders of the turn in a residual, the strongest first; none where the axis is linear or turns less than one and a half times.
struct OrderLine { double order, power, statistic; };   // periods per turn; mean square times rows; deviations of chance
std::vector<OrderLine> order_lines(const Equation &equation, const Eigen::VectorXd &residual);

}  // namespace driveid::diagnose
