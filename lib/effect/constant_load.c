/* SPDX-License-Identifier: Apache-2.0 */
#include "effect/internal.h"

static void fill(const double *shape, const driveid_effect_state *state, double *memory, double *column) {
    (void)shape;
    (void)memory;
    (void)state;
    column[0] = 1.0;
}

const driveid_effect_info driveid_effect_constant_load = {
    .name = "constant_load",
    .equation = "tau = tau_0",
    .kind = DRIVEID_EFFECT_TERM, .domains = DRIVEID_EFFECT_MECHANICAL, .needs = DRIVEID_NEED_SPEED,
    .params = 1, .columns = 1,
    .param = {{"tau_0", "F_0", DRIVEID_DIM_FORCE, -1e4, 1e4, 0.005, "load that always pulls the same way"}},
    .confused_with = {"current_offset", "asymmetric_friction", "gravity_unbalance"},
    .signature = "residual has a mean that does not depend on speed, direction or position",
    .separated_by = "an independent torque, or the electrical equation with a rest at zero current: a current offset shows in the voltage too, a load does not",
    .literature = "weight of a vertical axis, preload, unbalanced counterweight",
    .fill = fill, .publish = driveid_publish_plain, .resolve = driveid_resolve_plain,
};
