/* SPDX-License-Identifier: Apache-2.0 */
#include "effect/internal.h"

static void fill(const double *shape, const driveid_effect_state *state, double *memory, double *column) {
    (void)shape;
    (void)memory;
    column[0] = (state->current_A > 0.0) - (state->current_A < 0.0);
}

const driveid_effect_info driveid_effect_dead_time_voltage = {
    .name = "dead_time_voltage",
    .equation = "v = V_d sign(i) lost in the inverter (dq: along the current vector)",
    .kind = DRIVEID_EFFECT_TERM, .domains = DRIVEID_EFFECT_ELECTRICAL, .needs = DRIVEID_NEED_CURRENT,
    .params = 1, .columns = 1,
    .param = {{"V_d", NULL, DRIVEID_DIM_VOLTAGE, 0.0, 1e3, 0.3, "voltage lost to dead time and switches"}},
    .confused_with = {"coulomb", "resistance_drift", "current_offset"},
    .signature = "voltage residual jumps with the sign of the current and does not depend on its size",
    .separated_by = "small and large currents of both signs at rest (locked shaft): the intercept is V_d, the slope is R",
    .literature = "Jeong and Park, The analysis and compensation of dead-time effects in PWM inverters, IEEE TIE 38(2), 1991",
    .fill = fill, .publish = driveid_publish_plain, .resolve = driveid_resolve_plain,
};
