/* SPDX-License-Identifier: Apache-2.0 */
/* s: the temperature column where there is one (1 = 10 K above 20 degC), else warming up from 0 at the start of the record to 1. */
#include "effect/internal.h"

static void fill(const double *shape, const driveid_effect_state *state, double *memory, double *column) {
    const double s = state->has_temperature ? (state->T_degC - 20.0) / 10.0 : 1.0 - exp(-state->t_s / shape[0]);
    (void)memory;
    column[0] = s * state->direction;
    column[1] = s * state->speed;
}

static void publish(const double *shape, const double *linear, double gain, double *param) {
    (void)gain;
    param[0] = linear[0];
    param[1] = linear[1];
    param[2] = shape[0];
}

static void resolve(const double *param, double gain, double *shape, double *linear) {
    (void)gain;
    linear[0] = param[0];
    linear[1] = param[1];
    shape[0] = param[2];
}

const driveid_effect_info driveid_effect_friction_drift = {
    .name = "friction_drift",
    .equation = "tau = s (dtau_c sign(omega) + dB omega); s = (T_degC - 20)/10, or without temperature s = 1 - exp(-t/T_w)",
    .kind = DRIVEID_EFFECT_DRIFT, .domains = DRIVEID_EFFECT_MECHANICAL, .needs = DRIVEID_NEED_SPEED,
    .params = 3, .shapes = 1, .columns = 2,
    .param = {{"dtau_c", "dF_c", DRIVEID_DIM_FORCE, -1e4, 1e4, -0.003, "change of Coulomb friction for 10 K, or from cold to warm"},
              {"dB", "db", DRIVEID_DIM_DAMPING, -1e4, 1e4, -1e-5, "change of damping, likewise"},
              {"T_w", NULL, DRIVEID_DIM_TIME, 0.5, 1e5, 120.0, "warm-up time constant (unused with a temperature column)"}},
    .shape = {{"T_w", DRIVEID_DIM_TIME, 0.5, 1e5, 120.0, 1, 0}},
    .confused_with = {"coulomb", "stribeck", "inertia_change", "resistance_drift"},
    .signature = "friction at the same speed changes from the beginning to the end of the record, or with temperature",
    .separated_by = "the same motion at the beginning and at the end, cold and warm, best with a temperature column",
    .literature = "Bittencourt and Gunnarsson, Static friction in a robot joint: modeling and identification of load and temperature effects, ASME JDSMC 134(5), 2012",
    .fill = fill, .publish = publish, .resolve = resolve,
};
