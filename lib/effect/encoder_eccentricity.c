/* SPDX-License-Identifier: Apache-2.0 */
#include "effect/internal.h"

const driveid_effect_info driveid_effect_encoder_eccentricity = {
    .name = "encoder_eccentricity",
    .equation = "theta_read = theta + a sin(theta + phi)",
    .kind = DRIVEID_EFFECT_CHANNEL, .domains = DRIVEID_EFFECT_MECHANICAL, .needs = DRIVEID_NEED_ANGLE | DRIVEID_NEED_ROTARY,
    .params = 2,
    .param = {{"a", NULL, DRIVEID_DIM_PHASE, 0.0, 0.5, 5e-3, "once-per-turn angle error"},
              {"phi", NULL, DRIVEID_DIM_PHASE, -DRIVEID_PI, DRIVEID_PI, 0.0, "phase"}},
    .confused_with = {"gravity_unbalance", "cogging", "eccentric_friction"},
    .signature = "residual goes once a turn and grows with the square of the speed (the false acceleration)",
    .separated_by = "whole turns at constant speeds of at least three sizes: false acceleration grows with speed squared, gravity does not grow",
    .literature = "Kavanagh, Performance analysis and compensation of M/T-type digital tachometers, IEEE TIM 50(4), 2001",
};
