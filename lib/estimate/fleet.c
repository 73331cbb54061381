/* SPDX-License-Identifier: Apache-2.0 */
/* The type-erased front of a fleet. */
#include "fleet_state.h"

#include <stdio.h>
#include <string.h>

#include "fsm_config.h"

static driveid_status refuse(char *reason, size_t size, const char *text, driveid_status status) {
    if (reason && size) snprintf(reason, size, "%s", text);
    return status;
}

/* Places of everything; 0 where the regression or its options are refused. */
static size_t lay_out(driveid_fleet *head, driveid_real type, const driveid_regression *regression, const driveid_estimator_options *options, uint32_t drives,
                      driveid_status *status, char *reason, size_t reason_size) {
    driveid_svf_common common;
    uint8_t level[DRIVEID_BANK_CHANNELS];
    memset(head, 0, sizeof *head);
    memset(&common, 0, sizeof common);
    *status = fsm_configure_common(&common, regression, options, level, reason, reason_size);
    if (*status) return 0;
    head->type = (uint32_t)type;
    head->drives = drives;
    const uint32_t used = fsm_pool_used(&common);
    return type == DRIVEID_F64 ? fleet_lay_out_f64(head, used) : fleet_lay_out_f32(head, used);
}

static int usable(driveid_real type, const driveid_regression *regression, const driveid_estimator_options *options, uint32_t drives) {
    return (type == DRIVEID_F64 || type == DRIVEID_F32) && regression && options && drives > 0 && drives <= 1u << 20;
}

size_t driveid_fleet_size(driveid_real type, const driveid_regression *regression, const driveid_estimator_options *options, uint32_t drives) {
    driveid_fleet head;
    driveid_status status;
    return usable(type, regression, options, drives) ? lay_out(&head, type, regression, options, drives, &status, NULL, 0) : 0;
}

driveid_status driveid_fleet_configure(driveid_fleet *self, size_t size, driveid_real type, const driveid_regression *regression,
                                       const driveid_estimator_options *options, uint32_t drives, char *reason, size_t reason_size) {
    driveid_fleet head;
    driveid_status status;
    if (reason && reason_size) reason[0] = 0;
    if (!self || !usable(type, regression, options, drives)) return refuse(reason, reason_size, "a fleet is 1 to 1048576 drives in f64 or f32", DRIVEID_ERR_ARGUMENT);
    const size_t needed = lay_out(&head, type, regression, options, drives, &status, reason, reason_size);
    if (!needed) return status ? status : refuse(reason, reason_size, "so many drives are more than this machine addresses", DRIVEID_ERR_CAPACITY);
    if (size < needed) return refuse(reason, reason_size, "storage is smaller than driveid_fleet_size()", DRIVEID_ERR_CAPACITY);
    memset(self, 0, needed);
    *self = head;
    return type == DRIVEID_F64 ? fleet_configure_f64((fleet_f64 *)(void *)self, regression, options, reason, reason_size)
                               : fleet_configure_f32((fleet_f32 *)(void *)self, regression, options, reason, reason_size);
}

driveid_status driveid_fleet_update(driveid_fleet *self, int64_t t_ns, const double *channel, driveid_status *status) {
    if (!self || !channel || !status) return DRIVEID_ERR_ARGUMENT;
    if (self->type == DRIVEID_F64) fleet_update_f64((fleet_f64 *)(void *)self, t_ns, channel, status);
    else fleet_update_f32((fleet_f32 *)(void *)self, t_ns, channel, status);
    return DRIVEID_OK;
}

driveid_status driveid_fleet_estimate(const driveid_fleet *self, uint32_t drive, driveid_estimate *out) {
    if (!self || !out || drive >= self->drives) return DRIVEID_ERR_ARGUMENT;
    return fsm_answer_of(self->type == DRIVEID_F64 ? fleet_common_f64((const fleet_f64 *)(const void *)self, drive) : fleet_common_f32((const fleet_f32 *)(const void *)self, drive), out);
}

void driveid_fleet_gap(driveid_fleet *self, uint32_t drive) {
    if (self && drive < self->drives) ((fleet_glance *)(void *)((unsigned char *)self + self->glance_at))[drive].gap_told = 1;
}

void driveid_fleet_restart(driveid_fleet *self, uint32_t drive) {
    if (!self || drive >= self->drives) return;
    if (self->type == DRIVEID_F64) fleet_restart_f64((fleet_f64 *)(void *)self, drive);
    else fleet_restart_f32((fleet_f32 *)(void *)self, drive);
}
