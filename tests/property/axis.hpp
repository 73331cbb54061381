// SPDX-License-Identifier: Apache-2.0
// A rigid axis as the estimator's regression, J d2theta + B dtheta = tau, and an estimator's storage.
#pragma once
#include <string>
#include <vector>

#include <driveid/estimate.h>

namespace plants {

inline driveid_regression axis_regression() {
    driveid_regression r{};
    r.equations = 1, r.channels = 2, r.params = 2, r.terms = 3, r.may_be_zero = 2;
    r.hold[1] = DRIVEID_HOLD_ZERO;
    r.term[0] = {0, 0, 2, 0, 1};
    r.term[1] = {0, 0, 1, 1, 1};
    r.term[2] = {0, 1, 0, DRIVEID_TERM_KNOWN, -1};
    return r;
}

struct AxisEstimator {
    std::vector<unsigned char> memory;
    std::string reason;          // why it was refused
    explicit AxisEstimator(const driveid_estimator_options &options, const char *method = "fsm", driveid_real type = DRIVEID_F64)
        : memory(driveid_estimator_size(method, type)), reason(300, '\0') {
        const driveid_regression r = axis_regression();
        driveid_estimator_configure(get(), memory.size(), method, type, &r, &options, reason.data(), reason.size());
        reason.resize(reason.find('\0'));
    }
    driveid_estimator *get() { return reinterpret_cast<driveid_estimator *>(memory.data()); }
};

} // namespace plants
