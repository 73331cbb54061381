/* SPDX-License-Identifier: Apache-2.0 */
#include "effect/internal.h"

static void fill(const double *shape, const driveid_effect_state *state, double *memory, double *column) {
    (void)shape;
    (void)memory;
    column[0] = sin(state->angle);
    column[1] = cos(state->angle);
}

static void publish(const double *shape, const double *linear, double gain, double *param) {
    double phase;
    (void)shape;
    (void)gain;
    driveid_polar(linear[0], linear[1], &param[0], &phase);
    param[1] = phase == 0.0 ? 0.0 : -phase;
}

static void resolve(const double *param, double gain, double *shape, double *linear) {
    (void)shape;
    (void)gain;
    linear[0] = param[0] * cos(param[1]);
    linear[1] = -param[0] * sin(param[1]);
}

const driveid_effect_info driveid_effect_gravity_unbalance = {
    .name = "gravity_unbalance",
    .equation = "tau = tau_g sin(theta - theta_0)",
    .kind = DRIVEID_EFFECT_TERM, .domains = DRIVEID_EFFECT_MECHANICAL, .needs = DRIVEID_NEED_ANGLE | DRIVEID_NEED_ROTARY,
    .params = 2, .columns = 2,
    .param = {{"tau_g", NULL, DRIVEID_DIM_FORCE, 0.0, 1e4, 0.02, "weight times lever"},
              {"theta_0", NULL, DRIVEID_DIM_PHASE, -DRIVEID_PI, DRIVEID_PI, 0.0, "angle at which it hangs"}},
    .confused_with = {"cogging", "eccentric_friction", "torque_ripple", "encoder_eccentricity", "constant_load"},
    .signature = "residual goes once a turn with the angle, at rest too, the same in both directions and at any current",
    .separated_by = "several whole turns slowly in both directions, and rests at angles a quarter turn apart",
    .literature = "any book on mechanics: pendulum",
    .fill = fill, .publish = publish, .resolve = resolve,
};
