/* SPDX-License-Identifier: Apache-2.0 */
#include "effect/internal.h"

static void fill(const double *shape, const driveid_effect_state *state, double *memory, double *column) {
    (void)shape;
    (void)memory;
    column[0] = state->direction;
}

const driveid_effect_info driveid_effect_coulomb = {
    .name = "coulomb",
    .equation = "tau = tau_c sign(omega)",
    .kind = DRIVEID_EFFECT_TERM, .domains = DRIVEID_EFFECT_MECHANICAL, .needs = DRIVEID_NEED_SPEED,
    .params = 1, .columns = 1,
    .param = {{"tau_c", "F_c", DRIVEID_DIM_FORCE, 0.0, 1e4, 0.01, "Coulomb friction"}},
    .confused_with = {"stribeck", "asymmetric_friction", "dead_zone", "hysteresis", "lugre", "eccentric_friction"},
    .signature = "residual jumps with the direction of motion and does not depend on speed",
    .separated_by = "both directions, slow and fast: at least two speed levels below a tenth of the highest, with reversals",
    .literature = "C. A. Coulomb 1785; Olsson, Astrom, Canudas de Wit, Gafvert, Lischinsky, Friction models and friction compensation, 1998",
    .fill = fill, .publish = driveid_publish_plain, .resolve = driveid_resolve_plain,
};
