/* SPDX-License-Identifier: Apache-2.0 */
/* q and poles for the full form of frequency shifting. */
#include "shifting.h"

#include <math.h>
#include <stdio.h>

/* Measured over oscillators, sample times and noise levels (tests/unit/shifting_test.cpp): hardly anything depends on the pole as long as it lies above the
 * signal's band; small q makes rows alike; noise wants a steeper roll-off. */
#define POLE_OVER_BAND 4.0
#define POLE_LEAST 0.7     /* times the bandwidth */
#define POLE_DT 0.25       /* beyond it the hold's error, and the samples' noise, come in unfiltered */
#define Q_SHARE 0.8        /* of the largest q that leaves every section stable */

driveid_status driveid_fsm_suggest(driveid_fsm_config *c, double dt_s, double bandwidth_rad_s, double noise, char *reason, size_t reason_size) {
    const char *fault = NULL;
    if (!c) return DRIVEID_ERR_ARGUMENT;
    if (!(dt_s > 0) || !(bandwidth_rad_s > 0) || !(noise >= 0) || !isfinite(dt_s) || !isfinite(bandwidth_rad_s) || !isfinite(noise)) fault = "dt_s and bandwidth_rad_s must be above 0, noise not below";
    else if (c->order < 1 || c->order > DRIVEID_FSM_ORDER_MAX) fault = "order must be 1..6";
    else if (bandwidth_rad_s * POLE_LEAST > POLE_DT / dt_s) fault = "the sample time is too long for this bandwidth: sample at 18 times the bandwidth in hertz at least";
    if (fault) {
        if (reason && reason_size) snprintf(reason, reason_size, "%s", fault);
        return DRIVEID_ERR_CONFIG;
    }
    const double pole = fmin(POLE_OVER_BAND * bandwidth_rad_s, POLE_DT / dt_s);
    const int wanted = c->order + (noise < 1e-3 ? 2 : 3);
    c->poles = (uint8_t)(wanted < DRIVEID_FSM_POLES_MAX ? wanted : DRIVEID_FSM_POLES_MAX);
    for (int k = 0; k < c->poles; k++) c->pole_rad_s[k] = pole;
    const int highest = c->order + shifting_unknowns(c) - 1;
    c->q_per_s = Q_SHARE * pole / (highest > 0 ? highest : 1);
    return shifting_check(c, reason, reason_size);
}
