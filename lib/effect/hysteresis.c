/* SPDX-License-Identifier: Apache-2.0 */
/* Dahl's model: Bouc-Wen with n = 1, beta = gamma. The memory is the bristle in units of its Coulomb deflection. */
#include "effect/internal.h"

static void fill(const double *shape, const driveid_effect_state *state, double *memory, double *column) {
    driveid_bristle_step(&memory[0], state->speed, 1.0, shape[0], state->dt_s);
    column[0] = memory[0];
}

const driveid_effect_info driveid_effect_hysteresis = {
    .name = "hysteresis",
    .equation = "tau = tau_h z; dz/dtheta = (1 - z sign(omega)) / theta_h (Dahl; Bouc-Wen with n = 1)",
    .kind = DRIVEID_EFFECT_STATE, .domains = DRIVEID_EFFECT_MECHANICAL, .needs = DRIVEID_NEED_SPEED,
    .params = 2, .shapes = 1, .columns = 1, .memory = 1,
    .param = {{"tau_h", "F_h", DRIVEID_DIM_FORCE, 0.0, 1e4, 0.01, "height of the loop"},
              {"theta_h", "x_h", DRIVEID_DIM_LENGTH, 1e-4, 10.0, 0.05, "travel after a reversal in which 63 % of it builds up"}},
    .shape = {{"theta_h", DRIVEID_DIM_LENGTH, 1e-4, 10.0, 0.05, 1, 0}},
    .subsumes = {"coulomb"},
    .confused_with = {"coulomb", "lugre", "stribeck", "backlash", "compliance"},
    .signature = "after each reversal the loss builds up over degrees of travel, whatever the speed",
    .separated_by = "reversals at several amplitudes (from a part of the loop to many loops) at two speeds: hysteresis goes with travel, not with time",
    .literature = "P. R. Dahl, A solid friction model, 1968; Y.-K. Wen, Method for random vibration of hysteretic systems, 1976",
    .fill = fill, .publish = driveid_publish_shaped, .resolve = driveid_resolve_shaped,
};
