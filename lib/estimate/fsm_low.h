/* SPDX-License-Identifier: Apache-2.0 */
/* The prefilters of the economical form: cascades as in base/bank.h at the row rate, side by side, so that one step moves all of them. They are slow and
 * their steps small: f64 in every number type. Every channel is joined by Hermite cubics; the answer to the initial conditions comes as the last channel. */
#ifndef DRIVEID_ESTIMATE_FSM_LOW_H
#define DRIVEID_ESTIMATE_FSM_LOW_H

#include <stdint.h>

#include "base/bank.h"

#define FSM_LOW 4 /* prefilters */

typedef struct fsm_low {
    uint8_t sections, level[DRIVEID_BANK_CHANNELS];
    int64_t dt_ns;
    driveid_bank_f64 kernel[FSM_LOW]; /* pole and coefficients of each */
    double p[DRIVEID_SECTIONS_MAX][FSM_LOW], f[DRIVEID_SECTIONS_MAX][FSM_LOW], q[DRIVEID_SECTIONS_MAX][FSM_LOW], c[DRIVEID_SECTIONS_MAX][FSM_LOW];
    double input[DRIVEID_BANK_CHANNELS], slope[DRIVEID_BANK_CHANNELS];
    double w[DRIVEID_BANK_CHANNELS][DRIVEID_SECTIONS_MAX][FSM_LOW]; /* section minus input */
} fsm_low;

/* level[channels]: the channel's own value counts, not only its derivatives; pole_rad_s[FSM_LOW]. */
void fsm_low_init(fsm_low *low, unsigned channels, unsigned sections, const double *pole_rad_s, const uint8_t *level);
void fsm_low_start(fsm_low *low, unsigned channels, const double *channel, const double *slope);
void fsm_low_step(fsm_low *low, unsigned channels, int64_t dt_ns, const double *channel, const double *slope);
/* sum[k] += factor * d^derivative channel behind prefilter k. */
void fsm_low_add(const fsm_low *low, unsigned channel, unsigned derivative, double factor, double *sum);

#endif
