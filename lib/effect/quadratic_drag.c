/* SPDX-License-Identifier: Apache-2.0 */
#include "effect/internal.h"

static void fill(const double *shape, const driveid_effect_state *state, double *memory, double *column) {
    (void)shape;
    (void)memory;
    column[0] = fabs(state->speed) * state->speed;
}

const driveid_effect_info driveid_effect_quadratic_drag = {
    .name = "quadratic_drag",
    .equation = "tau = c |omega| omega",
    .kind = DRIVEID_EFFECT_TERM, .domains = DRIVEID_EFFECT_MECHANICAL, .needs = DRIVEID_NEED_SPEED,
    .params = 1, .columns = 1,
    .param = {{"c", NULL, DRIVEID_DIM_DRAG, 0.0, 1e4, 1e-7, "drag of air or liquid"}},
    .confused_with = {"asymmetric_friction", "torque_saturation", "coulomb"},
    .signature = "residual against speed bends upward at high speed, the same in both directions",
    .separated_by = "constant speeds at a third, two thirds and the whole of the highest, both directions, and a coast-down",
    .literature = "Rayleigh's drag equation; fans and pumps: torque goes with the square of speed",
    .fill = fill, .publish = driveid_publish_plain, .resolve = driveid_resolve_plain,
};
