// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diagnose/record.hpp"

namespace driveid::diagnose {

// Start values a_k, b_k of an lti structure by least squares through modulating functions: y^(n) + sum a_k y^(k) = sum b_k u^(k).
bool start_lti(driveid_model &model, const std::vector<Prepared> &training, std::string &bad);

}  // namespace driveid::diagnose
