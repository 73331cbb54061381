/* SPDX-License-Identifier: Apache-2.0 */
#include "effect/internal.h"

static void fill(const double *shape, const driveid_effect_state *state, double *memory, double *column) {
    (void)memory;
    column[0] = state->t_s >= shape[0] ? state->accel : 0.0;
}

const driveid_effect_info driveid_effect_inertia_change = {
    .name = "inertia_change",
    .equation = "J becomes J + dJ at t = t_step",
    .kind = DRIVEID_EFFECT_DRIFT, .domains = DRIVEID_EFFECT_MECHANICAL, .needs = DRIVEID_NEED_SPEED | DRIVEID_NEED_ACCEL,
    .params = 2, .shapes = 1, .columns = 1,
    .param = {{"dJ", "dm", DRIVEID_DIM_INERTIA, -1e4, 1e4, 5e-5, "change of inertia"},
              {"t_step", NULL, DRIVEID_DIM_TIME, 0.0, 1e6, 5.0, "instant of the change, from the start of the record"}},
    .shape = {{"t_step", DRIVEID_DIM_TIME, 0.0, 1e6, 5.0, 0, 0}},
    .confused_with = {"torque_saturation", "compliance", "friction_drift"},
    .signature = "residual goes with the acceleration before and after an instant, with another factor",
    .separated_by = "accelerations before and after the suspected change; a wrong K_t scales everything and has no instant",
    .literature = "gripping or dropping a load; winders: J of radius",
    .fill = fill, .publish = driveid_publish_shaped, .resolve = driveid_resolve_shaped,
};
