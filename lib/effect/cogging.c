/* SPDX-License-Identifier: Apache-2.0 */
#include "effect/internal.h"

static void fill(const double *shape, const driveid_effect_state *state, double *memory, double *column) {
    (void)memory;
    column[0] = sin(shape[0] * state->angle);
    column[1] = cos(shape[0] * state->angle);
}

const driveid_effect_info driveid_effect_cogging = {
    .name = "cogging",
    .equation = "tau = A_N sin(N theta + phi_N), current-free; once in the model for each order N",
    .kind = DRIVEID_EFFECT_TERM, .domains = DRIVEID_EFFECT_MECHANICAL, .needs = DRIVEID_NEED_ANGLE,
    .params = 3, .shapes = 1, .columns = 2, .repeats = 1,
    .param = {{"N", "k", DRIVEID_DIM_ORDER, 1.0, 1e4, 12.0, "periods per turn (linear axis: wave number)"},
              {"A", NULL, DRIVEID_DIM_FORCE, 0.0, 1e4, 0.005, "amplitude"},
              {"phi", NULL, DRIVEID_DIM_PHASE, -DRIVEID_PI, DRIVEID_PI, 0.0, "phase"}},
    .shape = {{"N", DRIVEID_DIM_ORDER, 1.0, 400.0, 12.0, 0, 1}},
    .confused_with = {"torque_ripple", "gravity_unbalance", "eccentric_friction", "encoder_eccentricity"},
    .signature = "residual is periodic in the angle, many periods a turn, at any current, the same in both directions",
    .separated_by = "slow turns (the order must stay below half the sampling rate) at two different load currents: ripple grows with current, cogging does not",
    .literature = "Zhu and Howe, Influence of design parameters on cogging torque, IEEE Trans. Energy Conversion 15(4), 2000",
    .fill = fill, .publish = driveid_publish_wave, .resolve = driveid_resolve_wave,
};
