// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diagnose/explain.hpp"

namespace driveid::diagnose {

// Values and intervals of the accepted effects by output error on the training records. The equation that found them sees smoothed motions:
// good for deciding, biased for values.
void refine_ranked(Explanation &explanation);

}  // namespace driveid::diagnose
