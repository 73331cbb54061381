/* SPDX-License-Identifier: Apache-2.0 */
/* The part of frequency shifting that does not depend on the number type. */
#ifndef DRIVEID_ESTIMATE_SHIFTING_H
#define DRIVEID_ESTIMATE_SHIFTING_H

#include <driveid/fsm.h>

int shifting_inputs(const driveid_fsm_config *config);            /* m + 1, or 0 */
int shifting_unknowns(const driveid_fsm_config *config);
driveid_status shifting_check(const driveid_fsm_config *config, char *reason, size_t reason_size);
double shifting_binomial(int n, int k);
/* gamma_{l,k} of s^i [EQ FSM-14] */
double shifting_gamma(int l, int k, int i, double q);

/* Exact step of the cascade a[n] over h: out[j][0..n-1] transition, out[j][n] held input, out[j][n+1] ramp from 0 to 1. */
void shifting_transition(const double *a, int n, double h, double out[DRIVEID_FSM_POLES_MAX][DRIVEID_FSM_POLES_MAX + 2]);

driveid_status shifting_solve(const driveid_fsm_config *config, const double *s, const double *s_c, double small, driveid_fsm_estimate *out);

#endif
