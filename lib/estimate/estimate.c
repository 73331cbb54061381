/* SPDX-License-Identifier: Apache-2.0 */
/* The type-erased front: method and number type by name. */
#include <driveid/estimate.h>

#include <stdio.h>
#include <string.h>

#include "adm.h"
#include "fsm_config.h"
#include "fsm_state.h"
#include "kernel.h"
#include "q31.h"
#include "recursive.h"
#include "tones.h"

typedef struct tones_f64 { kernel_f64 inner; tones tones; } tones_f64;
typedef struct tones_f32 { kernel_f32 inner; tones tones; } tones_f32;
typedef struct tones_q31 { q31_state inner; tones tones; } tones_q31;

struct driveid_estimator {
    uint32_t row; /* of the table below */
    union {
        driveid_svf_common common; /* first member of each state */
        learner learner;
        fsm_f64 fsm64;
        fsm_f32 fsm32;
        recursive_f64 recursive64;
        recursive_f32 recursive32;
        kernel_f64 kernel64;
        kernel_f32 kernel32;
        adm_f64 adm64;
        adm_f32 adm32;
        q31_state q31;
        tones_f64 tones64;
        tones_f32 tones32;
        tones_q31 tones31;
    } state;
};

_Static_assert(sizeof(driveid_estimator) <= DRIVEID_ESTIMATOR_BYTES, "DRIVEID_ESTIMATOR_BYTES is too small");

/* learn NULL: frequency shifting, or fixed point, whose rows follow q31_kind (frequency: over discrete). tones: where they stand, 0: none. */
static const struct {
    const char *method;
    driveid_real type;
    size_t bytes;
    const learn_method *learn;
    size_t tones;
} table[] = {
    {"fsm", DRIVEID_F64, sizeof(fsm_f64), NULL, 0},
    {"fsm", DRIVEID_F32, sizeof(fsm_f32), NULL, 0},
    {"rls", DRIVEID_F64, sizeof(recursive_f64), &rls_method_f64, 0},
    {"rls", DRIVEID_F32, sizeof(recursive_f32), &rls_method_f32, 0},
    {"kalman", DRIVEID_F64, sizeof(recursive_f64), &kalman_method_f64, 0},
    {"kalman", DRIVEID_F32, sizeof(recursive_f32), &kalman_method_f32, 0},
    {"window", DRIVEID_F64, sizeof(kernel_f64), &window_method_f64, 0},
    {"window", DRIVEID_F32, sizeof(kernel_f32), &window_method_f32, 0},
    {"discrete", DRIVEID_F64, sizeof(kernel_f64), &discrete_method_f64, 0},
    {"discrete", DRIVEID_F32, sizeof(kernel_f32), &discrete_method_f32, 0},
    {"adm", DRIVEID_F64, sizeof(adm_f64), &adm_method_f64, 0},
    {"adm", DRIVEID_F32, sizeof(adm_f32), &adm_method_f32, 0},
    {"frequency", DRIVEID_F64, sizeof(tones_f64), &discrete_method_f64, offsetof(tones_f64, tones)},
    {"frequency", DRIVEID_F32, sizeof(tones_f32), &discrete_method_f32, offsetof(tones_f32, tones)},
    {"fsm", DRIVEID_Q31, sizeof(q31_state), NULL, 0},
    {"rls", DRIVEID_Q31, sizeof(q31_state), NULL, 0},
    {"window", DRIVEID_Q31, sizeof(q31_state), NULL, 0},
    {"discrete", DRIVEID_Q31, sizeof(q31_state), NULL, 0},
    {"frequency", DRIVEID_Q31, sizeof(tones_q31), NULL, offsetof(tones_q31, tones)},
};
enum { ROWS = sizeof table / sizeof table[0], FIRST_Q31 = ROWS - 5 };

static driveid_status refuse(char *reason, size_t size, const char *text, driveid_status status) {
    if (reason && size) snprintf(reason, size, "%s", text);
    return status;
}

static int find(const char *method, driveid_real type) {
    for (int i = 0; i < ROWS && method; i++)
        if (strcmp(method, table[i].method) == 0 && table[i].type == type) return i;
    return -1;
}

size_t driveid_estimator_size(const char *method, driveid_real type) {
    const int row = find(method, type);
    return row < 0 ? 0 : offsetof(driveid_estimator, state) + table[row].bytes;
}

static tones *tones_of(driveid_estimator *self) {
    const size_t at = table[self->row].tones;
    return at ? (tones *)(void *)((unsigned char *)&self->state + at) : NULL;
}

static driveid_status configure(driveid_estimator *self, unsigned row, const driveid_regression *regression, const driveid_estimator_options *options,
                                char *reason, size_t reason_size) {
    const driveid_real type = table[row].type;
    if (table[row].learn) return learn_configure(&self->state.learner, table[row].learn, regression, options, reason, reason_size);
    if (type == DRIVEID_Q31) {
        const q31_kind kind = table[row].tones ? Q31_DISCRETE : (q31_kind)(row - FIRST_Q31);
        return q31_configure(&self->state.q31, kind, regression, options, reason, reason_size);
    }
    return type == DRIVEID_F64 ? driveid_svf_configure_f64(&self->state.fsm64, sizeof self->state.fsm64, regression, options, reason, reason_size)
                               : driveid_svf_configure_f32(&self->state.fsm32, sizeof self->state.fsm32, regression, options, reason, reason_size);
}

driveid_status driveid_estimator_configure(driveid_estimator *self, size_t size, const char *method, driveid_real type,
                                           const driveid_regression *regression,
                                           const driveid_estimator_options *options, char *reason, size_t reason_size) {
    if (reason && reason_size) reason[0] = 0;
    if (!self || !regression || !options || !method)
        return refuse(reason, reason_size, "null argument", DRIVEID_ERR_ARGUMENT);
    const int row = find(method, type);
    if (row < 0) return refuse(reason, reason_size, "this method does not exist in this number type: " DRIVEID_ESTIMATOR_METHODS, DRIVEID_ERR_CONFIG);
    if (size < driveid_estimator_size(method, type)) return refuse(reason, reason_size, "storage is smaller than driveid_estimator_size()", DRIVEID_ERR_CAPACITY);
    self->row = (uint32_t)row;
    const driveid_status status = configure(self, self->row, regression, options, reason, reason_size);
    tones *t = tones_of(self);
    return !status && t && !tones_configure(t, &self->state.common, reason, reason_size) ? DRIVEID_ERR_CONFIG : status;
}

static driveid_status inner_update(driveid_estimator *self, int64_t t_ns, const double *channel) {
    const learn_method *learn = table[self->row].learn;
    if (learn) return learn_update(&self->state.learner, learn, t_ns, channel);
    if (self->row >= FIRST_Q31) return q31_update(&self->state.q31, t_ns, channel);
    return table[self->row].type == DRIVEID_F64 ? driveid_svf_update_f64(&self->state.fsm64, t_ns, channel)
                                                : driveid_svf_update_f32(&self->state.fsm32, t_ns, channel);
}

static void inner_restart(driveid_estimator *self) {
    const learn_method *learn = table[self->row].learn;
    if (learn) learn_restart(&self->state.learner, learn);
    else if (self->row >= FIRST_Q31) q31_restart(&self->state.q31);
    else if (table[self->row].type == DRIVEID_F64) driveid_svf_restart_f64(&self->state.fsm64);
    else driveid_svf_restart_f32(&self->state.fsm32);
}

/* The signal is at other frequencies: what was learnt is of those before. */
static driveid_status anew(driveid_estimator *self, tones *t, driveid_status status, int64_t t_ns) {
    if (!t->changed) return status;
    const uint32_t restarts = self->state.common.answer.restarts + 1;
    inner_restart(self);
    tones_restart(t);
    self->state.common.answer.restarts = restarts;
    self->state.common.restart_ns = t_ns;
    return DRIVEID_NOT_YET;
}

/* What the tones of a fixed-point estimator see is what its window saw. */
static driveid_status follow_count(driveid_estimator *self, tones *t, driveid_status status, int64_t t_ns) {
    const q31_state *q = &self->state.q31;
    return anew(self, t, tones_follow_count(t, &q->common, status, t_ns, q->ring[q->newest]), t_ns);
}

driveid_status driveid_estimator_update(driveid_estimator *self, int64_t t_ns, const double *channel) {
    if (!self || !channel) return DRIVEID_ERR_ARGUMENT;
    const driveid_status status = inner_update(self, t_ns, channel);
    tones *t = tones_of(self);
    if (!t) return status;
    return self->row >= FIRST_Q31 ? follow_count(self, t, status, t_ns) : anew(self, t, tones_follow(t, &self->state.common, status, t_ns, channel[0]), t_ns);
}

driveid_status driveid_estimator_estimate(const driveid_estimator *self, driveid_estimate *out) {
    if (!self || !out) return DRIVEID_ERR_ARGUMENT;
    const size_t at = table[self->row].tones;
    return at ? tones_answer_of((const tones *)(const void *)((const unsigned char *)&self->state + at), out) : fsm_answer_of(&self->state.common, out);
}

void driveid_estimator_gap(driveid_estimator *self) {
    if (self) self->state.common.gap_told = 1;
}

void driveid_estimator_restart(driveid_estimator *self) {
    if (!self) return;
    inner_restart(self);
    tones *t = tones_of(self);
    if (t) tones_restart(t);
}

uint32_t driveid_estimator_saturations(const driveid_estimator *self) { return self && self->row >= FIRST_Q31 ? self->state.q31.saturations : 0; }

driveid_status driveid_estimator_update_counts(driveid_estimator *self, int64_t t_ns, const int32_t *count) {
    if (!self || !count || self->row < FIRST_Q31) return DRIVEID_ERR_ARGUMENT;
    const driveid_status status = q31_update_counts(&self->state.q31, t_ns, count);
    tones *t = tones_of(self);
    return t ? follow_count(self, t, status, t_ns) : status;
}
