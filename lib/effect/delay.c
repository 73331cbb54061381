/* SPDX-License-Identifier: Apache-2.0 */
#include "effect/internal.h"

const driveid_effect_info driveid_effect_delay = {
    .name = "delay",
    .equation = "u_effective(t) = u(t - T_d)",
    .kind = DRIVEID_EFFECT_CHANNEL, .domains = DRIVEID_EFFECT_MECHANICAL | DRIVEID_EFFECT_ELECTRICAL, .needs = DRIVEID_NEED_DRIVE,
    .params = 1,
    .param = {{"T_d", NULL, DRIVEID_DIM_TIME, 0.0, 0.5, 2e-3, "pure dead time between command or current channel and response"}},
    .confused_with = {"compliance", "lugre"},
    .signature = "residual goes with the rate of change of the input, whatever speed and position",
    .separated_by = "fast input changes (square wave, PRBS, chirp): a dead time has no resonance, a compliance has one",
    .literature = "Belkoura, Richard, Fliess, Parameters estimation of systems with delayed and structured entries, Automatica 45(5), 2009",
};
