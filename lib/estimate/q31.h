/* SPDX-License-Identifier: Apache-2.0 */
/* The fixed-point form of fsm, rls, window and discrete: integer filters, rows and sums; the solve, at the rate of answers, is fsm_solve in f64.
 *
 *   counts (Q30 of the declared range) -> bank, or window of samples -> rows (int32) -> sums (Q46 in int64) -> fsm_sums -> answer
 *
 * fsm: s^i/D as known regressors from the start, as in f64; after a gap rows wait until the filters have settled. rls: least squares with
 * forgetting in information form, whose recursion integers do exactly. window, discrete: one window of 20/bandwidth.
 * Scaling: counts = value / range * 2^30; channels of which only derivatives are used may run through any number of turns, the counts then
 * wrap and only differences count; others saturate. A derivative's column is brought up by 3 bits an order (1 in windows): what moves faster than about
 * bandwidth/8 (bandwidth/2) at full range is beyond its scale, and its row is left out.
 * Stamps: one sample time; a stamp off by more than an eighth of it is a gap. No libm, no floating-point filter in the update.
 * The sizes below may be made smaller by the build of a small target. */
#ifndef DRIVEID_ESTIMATE_Q31_H
#define DRIVEID_ESTIMATE_Q31_H

#include "fsm_solution.h"
#include "fsm_state.h"
#include "kernel.h"

#ifndef DRIVEID_Q31_POOL
#define DRIVEID_Q31_POOL 8000   /* int64: sums of all equations */
#endif
#ifndef DRIVEID_Q31_RING
#define DRIVEID_Q31_RING 4096   /* samples x channels */
#endif
#ifndef DRIVEID_Q31_WEIGHTS
#define DRIVEID_Q31_WEIGHTS 4096
#endif

#define Q31_LAGS (DRIVEID_Q31_POOL * 3 / 4) /* half of a square matrix and its diagonal: 3/4 of it at most */

typedef enum q31_kind { Q31_FSM, Q31_RLS, Q31_WINDOW, Q31_DISCRETE } q31_kind;

typedef struct q31_sums {        /* of one equation */
    uint32_t at;                 /* its block in the pool: S, G[lags], open coarse row, ring of coarse rows */
    uint32_t lags_at;            /* its lagged sums, SI, for a solve */
    uint16_t count;
    uint8_t ring_next, ring_fill;
    int64_t weight, coarse_rows, weight2; /* Q16 */
} q31_sums;

typedef struct q31_state {
    driveid_svf_common common;
    uint8_t kind, fresh, forget_shift, coarse; /* fresh: initial conditions are regressors */
    uint8_t level[DRIVEID_CHANNELS_MAX];
    uint32_t row_every, row_left;
    uint32_t saturations, rows_left_out; /* of readings and filter states, which bend what follows; rows beyond their scale, which do not */
    int64_t settled_ns;
    double count_per_SI[DRIVEID_CHANNELS_MAX];
    double scale[DRIVEID_EQUATIONS_MAX][FSM_COLUMNS_MAX]; /* SI of one unit of a row's column */
    int32_t gain[DRIVEID_TERMS_MAX];
    uint8_t shift[DRIVEID_TERMS_MAX];
    /* bank: coefficients as in base/bank.h, Q31 */
    int32_t p[DRIVEID_SECTIONS_MAX], f[DRIVEID_SECTIONS_MAX], q[DRIVEID_SECTIONS_MAX];
    int32_t w[DRIVEID_CHANNELS_MAX + 1][DRIVEID_SECTIONS_MAX];
    int32_t input[DRIVEID_CHANNELS_MAX], move[DRIVEID_CHANNELS_MAX];
    /* window */
    uint8_t of_term[DRIVEID_TERMS_MAX];
    uint16_t length, fill, newest;
    int32_t ring[DRIVEID_Q31_RING], weight[DRIVEID_Q31_WEIGHTS];
    q31_sums sums[DRIVEID_EQUATIONS_MAX];
    double lags[Q31_LAGS];
    int64_t pool[DRIVEID_Q31_POOL];
} q31_state;

driveid_status q31_configure(q31_state *self, q31_kind kind, const driveid_regression *regression,
                             const driveid_estimator_options *options, char *reason, size_t reason_size);
driveid_status q31_update(q31_state *self, int64_t t_ns, const double *channel);
/* Counts of the channels, as a converter gives them: value / range * 2^30. */
driveid_status q31_update_counts(q31_state *self, int64_t t_ns, const int32_t *count);
void q31_restart(q31_state *self);

/* q31_filter.c: coefficients and scales; the filters; a row of int32 (params, initial conditions, y). Row: 0 where it saturated. */
driveid_status q31_prepare(q31_state *self, char *reason, size_t reason_size);
void q31_filter_start(q31_state *self, const int32_t *count);
void q31_filter_step(q31_state *self, const int32_t *count);
int q31_row(q31_state *self, unsigned equation, int32_t *row);

/* q31_sums.c */
int q31_lay_out(q31_state *self); /* 0: the pool is too small */
void q31_sums_row(q31_state *self, unsigned equation, const int32_t *row);
void q31_sums_skip(q31_state *self);
void q31_sums_clear(q31_state *self);
void q31_gather(q31_state *self, unsigned equation, fsm_sums *out);

#endif
