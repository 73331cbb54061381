// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diagnose/record.hpp"

namespace driveid::diagnose {

// Does the axis move in this record, and does its input do anything? Empty where both do, else what to record.
std::string standstill(const Prepared &record, const Roles &roles);

}  // namespace driveid::diagnose
