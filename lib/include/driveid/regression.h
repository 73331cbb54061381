/* SPDX-License-Identifier: Apache-2.0 */
/* Regression: a drive's equations, linear in the unknown parameters, as a list of terms.
 *
 *   for each equation e:   sum over its terms of   factor * p(term) * d^k/dt^k channel(term)  =  0
 *
 * where p(term) is the unknown theta[param], or 1 where param is DRIVEID_TERM_KNOWN. The general n-th order
 * input-output equation [EQ FSM-1] is one such list; a rigid axis is
 *   J * d2(theta) + B * d1(theta) + tau_c * sign(omega) + tau_0 * 1 - (K_t * i) = 0.
 * Channels are filled by the caller from a sample: measured signals, products of them (omega_e * i_q), or known
 * regressors (sign of speed, one). Every estimator in lib/estimate reads this one form. */
#ifndef DRIVEID_REGRESSION_H
#define DRIVEID_REGRESSION_H

#include <stdint.h>

#include <driveid/sample.h>

/* A build for a small target may set these four lower, for all files alike. */
#ifndef DRIVEID_CHANNELS_MAX
#define DRIVEID_CHANNELS_MAX 12
#endif
#ifndef DRIVEID_TERMS_MAX
#define DRIVEID_TERMS_MAX 24
#endif
#ifndef DRIVEID_THETA_MAX
#define DRIVEID_THETA_MAX 13
#endif
#ifndef DRIVEID_EQUATIONS_MAX
#define DRIVEID_EQUATIONS_MAX 3
#endif
#define DRIVEID_ORDER_MAX 6
#define DRIVEID_TERM_KNOWN (-1)

typedef struct driveid_term {
    uint8_t equation;   /* 0 .. equations-1 */
    uint8_t channel;    /* 0 .. channels-1 */
    uint8_t derivative; /* 0 .. DRIVEID_ORDER_MAX */
    int8_t param;       /* 0 .. params-1, or DRIVEID_TERM_KNOWN */
    double factor;      /* known constant, SI */
} driveid_term;

typedef struct driveid_regression {
    uint8_t equations, channels, terms, params;
    uint16_t may_be_zero;               /* bit k: theta[k] = 0 is a sound answer (a friction), so a wide relative interval is not weak */
    double bandwidth_rad_s;             /* suggested bandwidth of the filters, 0: estimator's choice */
    double model_error;                 /* suggested options.model_error: what the terms miss of the drive, relative; 0 where they are exact */
    uint8_t hold[DRIVEID_CHANNELS_MAX]; /* driveid_hold of each channel */
    driveid_term term[DRIVEID_TERMS_MAX];
} driveid_regression;

#endif
