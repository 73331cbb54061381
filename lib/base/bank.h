/* SPDX-License-Identifier: Apache-2.0 */
/* The time-invariant filter bank under estimate: the same low-pass over every channel, and its derivatives.
 *
 * Method: a cascade of N equal sections  v_j' = lambda (v_{j-1} - v_j),  v_0 = channel,  unit gain at rest, so that
 *   s^i / (s/lambda + 1)^N  channel = lambda^i sum_m C(i,m) (-1)^(i-m) v_{N-m}            (Newton combination)
 * with i <= N (i = N takes the input itself). One step of length h is the exact lower-triangular Toeplitz matrix  e^-x x^k / k!,  x = lambda h; smooth channels
 * are a parabola through their last three readings, whose exact answer comes from the Poisson tails g_m = sum_{k>=m} e^-x x^k / k! and
 * their sums (positive numbers only, nothing cancels); held and averaged channels are exact as steps. States are kept relative to the last input, so an angle of 10^5 rad costs no digit, also in f32.
 * e^-x is computed at the nearest 1/64 and carried on by its series: jitter costs hardly an exp(), and equal steps have equal coefficients.
 *
 * Start: the channel is taken as zero (level) or as constant (derivatives only) before the first sample; what the drive
 * did before lies in span{ s^i / D }, i < n, which driveid_bank_impulse() gives as regressors [EQ FSM-3].
 * Cost a step: channels * N(N+1)/2 multiply-adds; coefficients for a new dt: about 4 N + 20. */
#ifndef DRIVEID_BASE_BANK_H
#define DRIVEID_BASE_BANK_H

#include <stdint.h>

#include <driveid/regression.h>

#define DRIVEID_SECTIONS_MAX (DRIVEID_ORDER_MAX + 2)
#define DRIVEID_BANK_CHANNELS (DRIVEID_CHANNELS_MAX + 1)

#include "real_f64.h"
#include "bank_decl.inc"
#include "real_f32.h"
#include "bank_decl.inc"

#endif
