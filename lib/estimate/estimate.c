/* SPDX-License-Identifier: Apache-2.0 */
/* The type-erased front: method and number type by name. */
#include <driveid/estimate.h>

#include <stdio.h>
#include <string.h>

#include "fsm_state.h"

struct driveid_estimator {
    uint32_t type;
    union {
        driveid_svf_common common; /* first member of both */
        fsm_f64 f64;
        fsm_f32 f32;
    } fsm;
};

_Static_assert(sizeof(driveid_estimator) <= DRIVEID_ESTIMATOR_BYTES, "DRIVEID_ESTIMATOR_BYTES is too small");

static driveid_status refuse(char *reason, size_t size, const char *text, driveid_status status) {
    if (reason && size) snprintf(reason, size, "%s", text);
    return status;
}

size_t driveid_estimator_size(const char *method, driveid_real type) {
    if (!method || strcmp(method, "fsm") != 0) return 0;
    const size_t head = offsetof(driveid_estimator, fsm);
    return type == DRIVEID_F64 ? head + sizeof(fsm_f64) : type == DRIVEID_F32 ? head + sizeof(fsm_f32) : 0;
}

driveid_status driveid_estimator_configure(driveid_estimator *self, size_t size, const char *method, driveid_real type,
                                           const driveid_regression *regression,
                                           const driveid_estimator_options *options, char *reason, size_t reason_size) {
    if (reason && reason_size) reason[0] = 0;
    if (!self || !regression || !options || !method)
        return refuse(reason, reason_size, "null argument", DRIVEID_ERR_ARGUMENT);
    const size_t needed = driveid_estimator_size(method, type);
    if (!needed) return refuse(reason, reason_size, "this method does not exist in this number type: take \"fsm\" with f64 or f32", DRIVEID_ERR_CONFIG);
    if (size < needed) return refuse(reason, reason_size, "storage is smaller than driveid_estimator_size()", DRIVEID_ERR_CAPACITY);
    self->type = (uint32_t)type;
    return type == DRIVEID_F64 ? driveid_svf_configure_f64(&self->fsm.f64, regression, options, reason, reason_size)
                               : driveid_svf_configure_f32(&self->fsm.f32, regression, options, reason, reason_size);
}

driveid_status driveid_estimator_update(driveid_estimator *self, int64_t t_ns, const double *channel) {
    if (!self || !channel) return DRIVEID_ERR_ARGUMENT;
    return self->type == DRIVEID_F64 ? driveid_svf_update_f64(&self->fsm.f64, t_ns, channel)
                                     : driveid_svf_update_f32(&self->fsm.f32, t_ns, channel);
}

driveid_status driveid_estimator_estimate(const driveid_estimator *self, driveid_estimate *out) {
    if (!self || !out) return DRIVEID_ERR_ARGUMENT;
    const driveid_svf_common *common = &self->fsm.common;
    const int have = common->status == DRIVEID_OK || common->status == DRIVEID_WEAK_EXCITATION || common->status == DRIVEID_RANK;
    if (have) *out = common->answer;
    return have && common->resting ? DRIVEID_FROZEN : common->status;
}

void driveid_estimator_restart(driveid_estimator *self) {
    if (!self) return;
    if (self->type == DRIVEID_F64) driveid_svf_restart_f64(&self->fsm.f64);
    else driveid_svf_restart_f32(&self->fsm.f32);
}
