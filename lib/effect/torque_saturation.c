/* SPDX-License-Identifier: Apache-2.0 */
/* Power law, so that a linear (p = 1), a quadratic (p = 2) and a late, sharp fall are one family; scaled by the current at which
 * a tenth of the torque constant is gone, which a user can check in a data sheet. */
#include "effect/internal.h"

static void fill(const double *shape, const driveid_effect_state *state, double *memory, double *column) {
    (void)memory;
    column[0] = pow(fabs(state->drive), shape[0]) * state->drive;
}

static void publish(const double *shape, const double *linear, double gain, double *param) {
    param[0] = linear[0] > 0.0 ? pow(0.1 * gain / linear[0], 1.0 / shape[0]) : 1e6;
    param[1] = shape[0];
}

static void resolve(const double *param, double gain, double *shape, double *linear) {
    shape[0] = param[1];
    linear[0] = 0.1 * gain / pow(param[0], param[1]);
}

const driveid_effect_info driveid_effect_torque_saturation = {
    .name = "torque_saturation",
    .equation = "tau_drive = K_t i (1 - 0.1 (|i|/i_10)^p): K_t falls with |i|",
    .kind = DRIVEID_EFFECT_CHANNEL, .domains = DRIVEID_EFFECT_MECHANICAL, .needs = DRIVEID_NEED_DRIVE,
    .params = 2, .shapes = 1, .columns = 1,
    .param = {{"i_10", "u_10", DRIVEID_DIM_DRIVE, 1e-3, 1e6, 5.0, "drive at which a tenth of the torque constant is gone"},
              {"p", NULL, DRIVEID_DIM_ONE, 0.5, 4.0, 2.0, "exponent of the fall"}},
    .shape = {{"p", DRIVEID_DIM_ONE, 0.5, 4.0, 2.0, 0, 0}},
    .confused_with = {"inertia_change", "load_dependent_friction", "quadratic_drag"},
    .signature = "residual goes with a high odd power of the current, whatever the speed",
    .separated_by = "accelerations from small to the highest current, in both directions, at low speed",
    .literature = "iron saturation: Bianchi, Electrical Machine Analysis Using Finite Elements, 2005",
    .fill = fill, .publish = publish, .resolve = resolve,
};
