/* SPDX-License-Identifier: Apache-2.0 */
#include "effect/internal.h"

static void fill(const double *shape, const driveid_effect_state *state, double *memory, double *column) {
    (void)memory;
    column[0] = state->gain * fmax(-shape[0], fmin(shape[0], state->drive));
}

static void publish(const double *shape, const double *linear, double gain, double *param) {
    (void)linear;
    (void)gain;
    param[0] = shape[0];
}

static void resolve(const double *param, double gain, double *shape, double *linear) {
    (void)gain;
    shape[0] = param[0];
    linear[0] = 1.0;
}

const driveid_effect_info driveid_effect_dead_zone = {
    .name = "dead_zone",
    .equation = "u_effective = u - u_d sign(u) beyond the threshold, 0 where |u| < u_d",
    .kind = DRIVEID_EFFECT_CHANNEL, .domains = DRIVEID_EFFECT_MECHANICAL | DRIVEID_EFFECT_ELECTRICAL, .needs = DRIVEID_NEED_DRIVE,
    .params = 1, .shapes = 1, .columns = 1, .fixed = 1,
    .param = {{"u_d", NULL, DRIVEID_DIM_DRIVE, 0.0, 1e4, 0.1, "threshold of the input"}},
    .shape = {{"u_d", DRIVEID_DIM_DRIVE, 0.0, 1e4, 0.1, 0, 0}},
    .confused_with = {"coulomb", "dead_time_voltage", "stribeck"},
    .signature = "no response while the input is below a threshold, a constant deficit with the sign of the input above",
    .separated_by = "decelerations in which input and speed have opposite signs: Coulomb friction follows the speed, a dead zone the input",
    .literature = "Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, 1996",
    .fill = fill, .publish = publish, .resolve = resolve,
};
