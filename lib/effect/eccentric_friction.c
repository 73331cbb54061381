/* SPDX-License-Identifier: Apache-2.0 */
#include "effect/internal.h"

static void fill(const double *shape, const driveid_effect_state *state, double *memory, double *column) {
    (void)memory;
    column[0] = state->direction;
    column[1] = state->direction * cos(shape[0] * state->angle);
    column[2] = state->direction * sin(shape[0] * state->angle);
}

static void publish(const double *shape, const double *linear, double gain, double *param) {
    const double amplitude = hypot(linear[1], linear[2]);
    (void)gain;
    param[0] = linear[0];
    param[1] = linear[0] != 0.0 ? amplitude / linear[0] : 0.0;
    param[2] = shape[0];
    param[3] = amplitude > 0.0 ? atan2(-linear[2], linear[1]) : 0.0;
}

static void resolve(const double *param, double gain, double *shape, double *linear) {
    (void)gain;
    shape[0] = param[2];
    linear[0] = param[0];
    linear[1] = param[0] * param[1] * cos(param[3]);
    linear[2] = -param[0] * param[1] * sin(param[3]);
}

const driveid_effect_info driveid_effect_eccentric_friction = {
    .name = "eccentric_friction",
    .equation = "tau = tau_c (1 + e cos(n theta + phi)) sign(omega)",
    .kind = DRIVEID_EFFECT_TERM, .domains = DRIVEID_EFFECT_MECHANICAL, .needs = DRIVEID_NEED_ANGLE | DRIVEID_NEED_SPEED,
    .params = 4, .shapes = 1, .columns = 3,
    .param = {{"tau_c", "F_c", DRIVEID_DIM_FORCE, 0.0, 1e4, 0.01, "mean Coulomb friction"},
              {"e", NULL, DRIVEID_DIM_ONE, 0.0, 1.0, 0.3, "relative variation over the turn"},
              {"n", "k", DRIVEID_DIM_ORDER, 1.0, 1e4, 1.0, "periods per turn (linear axis: wave number)"},
              {"phi", NULL, DRIVEID_DIM_PHASE, -DRIVEID_PI, DRIVEID_PI, 0.0, "phase"}},
    .shape = {{"n", DRIVEID_DIM_ORDER, 1.0, 8.0, 1.0, 0, 1}},
    .subsumes = {"coulomb"},
    .confused_with = {"coulomb", "gravity_unbalance", "cogging", "torque_ripple"},
    .signature = "friction goes with the angle: the periodic part of the residual changes sign with the direction",
    .separated_by = "the same turns in both directions: what turns round with the direction is friction, what does not is gravity or cogging",
    .literature = "bent shaft, eccentric seal or screw: position-dependent friction, Armstrong-Helouvry 1991",
    .fill = fill, .publish = publish, .resolve = resolve,
};
