// SPDX-License-Identifier: Apache-2.0
// How often an answer is right that was found with this evidence.
#pragma once

namespace driveid::diagnose {

// lead, gain: log-likelihood over the next explanation, and over none; explained: share of the removable error that all accepted effects take.
// Monotone in each. Fitted to how often answers were right, not to what they look like (docs/manual/explain.md says on which cases).
double confidence(double lead, double gain, double explained);

}  // namespace driveid::diagnose
