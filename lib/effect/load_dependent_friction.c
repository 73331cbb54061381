/* SPDX-License-Identifier: Apache-2.0 */
#include "effect/internal.h"

static void fill(const double *shape, const driveid_effect_state *state, double *memory, double *column) {
    (void)shape;
    (void)memory;
    column[0] = fabs(state->torque) * state->direction;
}

const driveid_effect_info driveid_effect_load_dependent_friction = {
    .name = "load_dependent_friction",
    .equation = "tau = mu |tau_load| sign(omega); tau_load is the driving torque that the gear transmits",
    .kind = DRIVEID_EFFECT_TERM, .domains = DRIVEID_EFFECT_MECHANICAL, .needs = DRIVEID_NEED_SPEED | DRIVEID_NEED_DRIVE,
    .params = 1, .columns = 1,
    .param = {{"mu", NULL, DRIVEID_DIM_ONE, 0.0, 1.0, 0.1, "share of the transmitted torque lost in the gear"}},
    .confused_with = {"coulomb", "stribeck", "torque_saturation", "inertia_change"},
    .signature = "friction grows with the torque transmitted: driving and braking at one speed differ in loss",
    .separated_by = "equal speeds under different loads: hard and gentle accelerations, or a weight hung on and taken off",
    .literature = "Dohring, Lee, Newman, A load-dependent transmission friction model, ICRA 1993",
    .fill = fill, .publish = driveid_publish_plain, .resolve = driveid_resolve_plain,
};
