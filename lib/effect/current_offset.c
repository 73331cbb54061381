/* SPDX-License-Identifier: Apache-2.0 */
#include "effect/internal.h"

static void fill(const double *shape, const driveid_effect_state *state, double *memory, double *column) {
    (void)shape;
    (void)memory;
    column[0] = state->electrical ? -state->resistance_ohm : state->gain;
}

const driveid_effect_info driveid_effect_current_offset = {
    .name = "current_offset",
    .equation = "i_true = i_read - i_0",
    .kind = DRIVEID_EFFECT_CHANNEL, .domains = DRIVEID_EFFECT_MECHANICAL | DRIVEID_EFFECT_ELECTRICAL, .needs = DRIVEID_NEED_CURRENT,
    .params = 1, .columns = 1,
    .param = {{"i_0", NULL, DRIVEID_DIM_CURRENT, -1e3, 1e3, 0.05, "constant error of the current reading"}},
    .confused_with = {"constant_load", "asymmetric_friction", "dead_time_voltage"},
    .signature = "residual has a constant mean in the torque equation and, times -R, in the voltage equation",
    .separated_by = "voltage beside current, or a stretch with the power stage off (the true current is zero), or an independent torque",
    .literature = "Chung and Sul, Analysis and compensation of current measurement error in vector-controlled AC motor drives, IEEE TIA 34(2), 1998",
    .fill = fill, .publish = driveid_publish_plain, .resolve = driveid_resolve_plain,
};
