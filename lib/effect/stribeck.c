/* SPDX-License-Identifier: Apache-2.0 */
#include "effect/internal.h"

static void fill(const double *shape, const driveid_effect_state *state, double *memory, double *column) {
    const double x = state->speed / shape[0];
    (void)memory;
    column[0] = state->direction;
    column[1] = exp(-x * x) * state->direction;
}

static void publish(const double *shape, const double *linear, double gain, double *param) {
    (void)gain;
    param[0] = linear[0];
    param[1] = linear[0] + linear[1];
    param[2] = shape[0];
}

static void resolve(const double *param, double gain, double *shape, double *linear) {
    (void)gain;
    shape[0] = param[2];
    linear[0] = param[0];
    linear[1] = param[1] - param[0];
}

const driveid_effect_info driveid_effect_stribeck = {
    .name = "stribeck",
    .equation = "tau = (tau_c + (tau_s - tau_c) exp(-|omega/omega_s|^2)) sign(omega)",
    .kind = DRIVEID_EFFECT_TERM, .domains = DRIVEID_EFFECT_MECHANICAL, .needs = DRIVEID_NEED_SPEED,
    .params = 3, .shapes = 1, .columns = 2,
    .param = {{"tau_c", "F_c", DRIVEID_DIM_FORCE, 0.0, 1e4, 0.01, "Coulomb friction at speed"},
              {"tau_s", "F_s", DRIVEID_DIM_FORCE, 0.0, 1e4, 0.016, "static friction near rest"},
              {"omega_s", "v_s", DRIVEID_DIM_SPEED, 1e-4, 1e3, 2.0, "Stribeck speed"}},
    .shape = {{"omega_s", DRIVEID_DIM_SPEED, 1e-4, 1e3, 2.0, 1, 0}},
    .subsumes = {"coulomb"},
    .confused_with = {"coulomb", "lugre", "hysteresis", "load_dependent_friction"},
    .signature = "residual against speed falls from rest to a minimum: more friction near standstill than at speed",
    .separated_by = "slow motion through the Stribeck speed in both directions: constant-speed steps on a logarithmic ladder down to a few rad/s",
    .literature = "R. Stribeck 1902; Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994",
    .fill = fill, .publish = publish, .resolve = resolve,
};
