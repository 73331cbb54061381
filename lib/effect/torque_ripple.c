/* SPDX-License-Identifier: Apache-2.0 */
#include "effect/internal.h"

static void fill(const double *shape, const driveid_effect_state *state, double *memory, double *column) {
    (void)memory;
    column[0] = state->torque * sin(shape[0] * state->angle);
    column[1] = state->torque * cos(shape[0] * state->angle);
}

const driveid_effect_info driveid_effect_torque_ripple = {
    .name = "torque_ripple",
    .equation = "tau = a_N K_t i sin(N theta + phi_N): the torque constant varies with the angle",
    .kind = DRIVEID_EFFECT_TERM, .domains = DRIVEID_EFFECT_MECHANICAL, .needs = DRIVEID_NEED_ANGLE | DRIVEID_NEED_DRIVE,
    .params = 3, .shapes = 1, .columns = 2, .repeats = 1,
    .param = {{"N", "k", DRIVEID_DIM_ORDER, 1.0, 1e4, 6.0, "periods per turn (linear axis: wave number)"},
              {"a", NULL, DRIVEID_DIM_ONE, 0.0, 1.0, 0.05, "amplitude as a share of the driving torque"},
              {"phi", NULL, DRIVEID_DIM_PHASE, -DRIVEID_PI, DRIVEID_PI, 0.0, "phase"}},
    .shape = {{"N", DRIVEID_DIM_ORDER, 1.0, 400.0, 6.0, 0, 1}},
    .confused_with = {"cogging", "eccentric_friction", "gravity_unbalance"},
    .signature = "residual is periodic in the angle and its amplitude follows the current, sign included",
    .separated_by = "slow turns at several load currents of both signs",
    .literature = "Jahns and Soong, Pulsating torque minimization techniques for permanent magnet AC motor drives, IEEE TIE 43(2), 1996",
    .fill = fill, .publish = driveid_publish_wave, .resolve = driveid_resolve_wave,
};
