// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diagnose/explain.hpp"

namespace driveid::diagnose {

// Values and intervals of the accepted effects by output error on the training records. The equation that found them sees smoothed motions:
// good for deciding, biased for values.
void refine_ranked(Explanation &explanation);

// An effect that the same data chose among many looks larger and surer than it is: its 95 % hold for all of the catalogue at once
// (Bonferroni over the candidates, a bound of the constant of Berk et al., Ann. Statist. 41, 2013). Returns the factor.
double widen_for_choice(Explanation &explanation);

}  // namespace driveid::diagnose
