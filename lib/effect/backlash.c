/* SPDX-License-Identifier: Apache-2.0 */
#include "effect/internal.h"

const driveid_effect_info driveid_effect_backlash = {
    .name = "backlash",
    .equation = "as compliance, with the twist theta - theta_l counted beyond the gap: |twist| < gap/2 transmits nothing",
    .kind = DRIVEID_EFFECT_STRUCTURE, .domains = DRIVEID_EFFECT_MECHANICAL, .needs = DRIVEID_NEED_SPEED | DRIVEID_NEED_ACCEL,
    .params = 4,
    .param = {{"gap", NULL, DRIVEID_DIM_LENGTH, 0.0, 1.0, 0.01, "whole width of the gap"},
              {"J_l", "m_l", DRIVEID_DIM_INERTIA, 1e-9, 1e4, 5e-5, "load side's part of the whole inertia J (unused where the model has two masses already)"},
              {"k", NULL, DRIVEID_DIM_STIFFNESS, 1e-3, 1e9, 50.0, "stiffness in contact (unused where the model has two masses already)"},
              {"d", NULL, DRIVEID_DIM_DAMPING, 0.0, 1e6, 0.005, "damping in contact (unused where the model has two masses already)"}},
    .confused_with = {"compliance", "hysteresis", "lugre"},
    .signature = "around torque reversals the motor runs free for a moment (residual like a smaller inertia), then knocks",
    .separated_by = "small torque reversals about rest at several amplitudes; load-side position shows the gap as lost motion",
    .literature = "Nordin and Gutman, Controlling mechanical systems with backlash: a survey, Automatica 38(10), 2002",
};
