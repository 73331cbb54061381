/* SPDX-License-Identifier: Apache-2.0 */
#include "effect/internal.h"

const driveid_effect_info driveid_effect_compliance = {
    .name = "compliance",
    .equation = "(J - J_l) ddtheta = tau - B dtheta - s; J_l ddtheta_l = s; s = k (theta - theta_l) + d (dtheta - dtheta_l)",
    .kind = DRIVEID_EFFECT_STRUCTURE, .domains = DRIVEID_EFFECT_MECHANICAL, .needs = DRIVEID_NEED_SPEED | DRIVEID_NEED_ACCEL,
    .params = 3,
    .param = {{"J_l", "m_l", DRIVEID_DIM_INERTIA, 1e-9, 1e4, 5e-5, "load side's part of the whole inertia J"},
              {"k", NULL, DRIVEID_DIM_STIFFNESS, 1e-3, 1e9, 20.0, "stiffness of shaft, belt or screw"},
              {"d", NULL, DRIVEID_DIM_DAMPING, 0.0, 1e6, 0.002, "damping inside it"}},
    .confused_with = {"backlash", "delay", "lugre", "hysteresis"},
    .signature = "residual rings at one frequency after each fast torque change: a resonance and an antiresonance",
    .separated_by = "a chirp or PRBS through the suspected resonance, small and large: a spring's frequency does not move with amplitude, a gap's does",
    .literature = "Vukosavic and Stojic, Suppression of torsional oscillations in a high-performance speed servo drive, IEEE TIE 45(1), 1998",
};
