/* SPDX-License-Identifier: Apache-2.0 */
/* The bristle in units of its Coulomb deflection z_c = tau_c/sigma_0: zeta = z/z_c, so that the loss is linear in tau_c alone. */
#include "effect/internal.h"

static void fill(const double *shape, const driveid_effect_state *state, double *memory, double *column) {
    const double level = driveid_stribeck_level(state->speed, shape[0], shape[1]);
    const double rate = driveid_bristle_step(&memory[0], state->speed, level, shape[2], state->dt_s);
    column[0] = memory[0] + shape[3] * rate;
}

static void publish(const double *shape, const double *linear, double gain, double *param) {
    (void)gain;
    param[0] = linear[0];
    param[1] = linear[0] * shape[1];
    param[2] = shape[0];
    param[3] = linear[0] / shape[2];
    param[4] = param[3] * shape[3];
}

static void resolve(const double *param, double gain, double *shape, double *linear) {
    (void)gain;
    linear[0] = param[0];
    shape[0] = param[2];
    shape[1] = param[0] > 0.0 ? param[1] / param[0] : 1.0;
    shape[2] = param[3] > 0.0 ? param[0] / param[3] : 1e-3;
    if (!(shape[2] > 1e-9)) shape[2] = 1e-9;
    shape[3] = param[3] > 0.0 ? param[4] / param[3] : 0.0;
}

const driveid_effect_info driveid_effect_lugre = {
    .name = "lugre",
    .equation = "tau = sigma_0 z + sigma_1 dz/dt; dz/dt = omega - sigma_0 |omega| z / (tau_c + (tau_s - tau_c) exp(-|omega/omega_s|^2))",
    .kind = DRIVEID_EFFECT_STATE, .domains = DRIVEID_EFFECT_MECHANICAL, .needs = DRIVEID_NEED_SPEED,
    .params = 5, .shapes = 4, .columns = 1, .memory = 1,
    .param = {{"tau_c", "F_c", DRIVEID_DIM_FORCE, 0.0, 1e4, 0.01, "Coulomb friction at speed"},
              {"tau_s", "F_s", DRIVEID_DIM_FORCE, 0.0, 1e4, 0.016, "static friction"},
              {"omega_s", "v_s", DRIVEID_DIM_SPEED, 1e-4, 1e3, 2.0, "Stribeck speed"},
              {"sigma_0", NULL, DRIVEID_DIM_STIFFNESS, 1e-6, 1e9, 20.0, "bristle stiffness"},
              {"sigma_1", NULL, DRIVEID_DIM_DAMPING, 0.0, 1e6, 0.02, "bristle damping"}},
    .shape = {{"omega_s", DRIVEID_DIM_SPEED, 1e-4, 1e3, 2.0, 1, 0},
              {"tau_s/tau_c", DRIVEID_DIM_ONE, 1.0, 4.0, 1.5, 0, 0},
              {"tau_c/sigma_0", DRIVEID_DIM_LENGTH, 1e-6, 0.02, 5e-4, 1, 0},
              {"sigma_1/sigma_0", DRIVEID_DIM_TIME, 0.0, 0.1, 1e-3, 0, 0}},
    .subsumes = {"coulomb", "stribeck"},
    .confused_with = {"stribeck", "coulomb", "hysteresis", "compliance"},
    .signature = "around reversals and at rest the axis moves like a stiff spring (micrometres, fractions of a degree) before it breaks away",
    .separated_by = "small torque ramps and sines below break-away, amplitude a few times the pre-sliding deflection, beside slow constant speeds",
    .literature = "Canudas de Wit, Olsson, Astrom, Lischinsky, A new model for control of systems with friction, IEEE TAC 40(3), 1995",
    .fill = fill, .publish = publish, .resolve = resolve,
};
