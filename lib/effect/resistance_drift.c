/* SPDX-License-Identifier: Apache-2.0 */
/* Winding heat: the temperature column where there is one (1 = 10 K above 20 degC), else a first-order thermal model driven by i^2
 * (1 = the steady state at 1 A). memory[0] is that heat. */
#include "effect/internal.h"

static void fill(const double *shape, const driveid_effect_state *state, double *memory, double *column) {
    const double i = state->current_A;
    double heat;
    if (state->has_temperature) {
        heat = (state->T_degC - 20.0) / 10.0;
    } else {
        memory[0] = i * i + (memory[0] - i * i) * exp(-state->dt_s / shape[0]);
        heat = memory[0];
    }
    column[0] = heat * i;
}

const driveid_effect_info driveid_effect_resistance_drift = {
    .name = "resistance_drift",
    .equation = "v = (R + dR h) i; h = (T_degC - 20)/10, or without temperature T_th dh/dt = (i/1 A)^2 - h",
    .kind = DRIVEID_EFFECT_DRIFT, .domains = DRIVEID_EFFECT_ELECTRICAL, .needs = DRIVEID_NEED_CURRENT,
    .params = 2, .shapes = 1, .columns = 1, .memory = 1,
    .param = {{"dR", NULL, DRIVEID_DIM_RESISTANCE, 0.0, 1e3, 0.01, "growth of R for 10 K, or at a steady 1 A where no temperature is recorded"},
              {"T_th", NULL, DRIVEID_DIM_TIME, 0.1, 1e5, 60.0, "thermal time constant of the winding (unused with a temperature column)"}},
    .shape = {{"T_th", DRIVEID_DIM_TIME, 0.1, 1e5, 60.0, 1, 0}},
    .confused_with = {"dead_time_voltage", "friction_drift"},
    .signature = "voltage residual goes with the current and grows as the winding warms up",
    .separated_by = "a minute at high current after a cold start, then the same motion again; best with a temperature column",
    .literature = "copper: 0.39 %/K, IEC 60034-1; Boglietti et al., Evolution and modern approaches for thermal analysis of electrical machines, IEEE TIE 56(3), 2009",
    .fill = fill, .publish = driveid_publish_shaped, .resolve = driveid_resolve_shaped,
};
