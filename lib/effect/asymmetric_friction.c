/* SPDX-License-Identifier: Apache-2.0 */
#include "effect/internal.h"

static void fill(const double *shape, const driveid_effect_state *state, double *memory, double *column) {
    const double d = state->direction;
    (void)shape;
    (void)memory;
    column[0] = 0.5 * (fabs(d) + d); /* share of the instant in forward motion */
    column[1] = -0.5 * (fabs(d) - d);
    column[2] = fabs(state->speed);
}

static void publish(const double *shape, const double *linear, double gain, double *param) {
    (void)shape;
    (void)gain;
    for (int k = 0; k < 3; k++) param[k] = linear[k];
}

static void resolve(const double *param, double gain, double *shape, double *linear) {
    (void)shape;
    (void)gain;
    for (int k = 0; k < 3; k++) linear[k] = param[k];
}

const driveid_effect_info driveid_effect_asymmetric_friction = {
    .name = "asymmetric_friction",
    .equation = "tau = tau_c_pos (omega > 0), -tau_c_neg (omega < 0), plus dB |omega|: damping B + dB forward, B - dB backward",
    .kind = DRIVEID_EFFECT_TERM, .domains = DRIVEID_EFFECT_MECHANICAL, .needs = DRIVEID_NEED_SPEED,
    .params = 3, .columns = 3,
    .param = {{"tau_c_pos", "F_c_pos", DRIVEID_DIM_FORCE, 0.0, 1e4, 0.012, "Coulomb friction forward"},
              {"tau_c_neg", "F_c_neg", DRIVEID_DIM_FORCE, 0.0, 1e4, 0.008, "Coulomb friction backward"},
              {"dB", "db", DRIVEID_DIM_DAMPING, -1e4, 1e4, 1e-5, "half the difference of damping, forward minus backward"}},
    .subsumes = {"coulomb"},
    .confused_with = {"coulomb", "constant_load", "current_offset", "quadratic_drag"},
    .signature = "residual against speed has another slope or another level forward than backward",
    .separated_by = "the same speeds in both directions (at least three each), and rests: a constant load pulls at rest too, friction does not",
    .literature = "Armstrong-Helouvry, Control of Machines with Friction, 1991",
    .fill = fill, .publish = publish, .resolve = resolve,
};
