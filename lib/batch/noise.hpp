// SPDX-License-Identifier: Apache-2.0
// Noise of a simulated output: a monic filter that makes the residual white.
//
//   F(q) = ((1 - q^-1) / (1 - c q^-1))^d / A(q)^-1,  d = 2 for a position, 1 else
//
// White noise on a sensor beside white noise on the input of an integrator (two of them for a position) is this process for one memory c:
// c = 1 is sensor noise alone (nothing is filtered), c = 0 input noise alone (differences). c is the one that leaves least; the short
// autoregression A takes what is left of colour. Filters start at rest where a window starts, as the drift does.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

namespace driveid::batch {

struct NoiseFilter {
  int order = 0;               // d; 0: passes everything
  double memory = 1;           // c
  std::vector<double> ar;
  void apply(double *x, std::size_t n) const;   // in place
};

// The filter of least power. power(filter) is the sum of squares of the filtered residual.
NoiseFilter fit_memory(int order, const std::function<double(const NoiseFilter &)> &power);

// Autoregression by least squares over pieces of one filtered residual, at rest before each piece.
std::vector<double> fit_short_memory(const std::vector<std::vector<double>> &pieces, int order);

}  // namespace driveid::batch
