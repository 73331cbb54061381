/* SPDX-License-Identifier: Apache-2.0 */
/* Frequency shifting, economical form: how one estimator is laid out.
 *
 *   samples -> bank (every sample) -> row of each equation (every 0.5/bandwidth) -> prefilters -> weighted sums -> answer
 *
 * A row is the filtered equation  y = phi theta + z c : phi the unknown terms, y the known ones, z the answers s^i/D to the
 * unknown initial conditions c [EQ FSM-3]. Any further causal filter of the rows keeps it exact, so a few prefilters
 * (stages, from the bank's bandwidth downwards) run side by side, and the answer comes from the one whose interval is
 * smallest: that is the one that fits the noise. Besides the sums S of products of the columns, lagged sums are kept: from them
 * follow, at any theta, the residual's autocorrelation and the long-run covariance of the score, hence honest intervals.
 * Sums lie so that the innermost loop has a constant length: S by pair and stage, lagged sums by pair and lag, and the columns of initial conditions
 * last, so that they cost nothing once the answers to them have died away. Only x_i(t) x_j(t-lag) + x_j(t) x_i(t-lag) is ever used, so only that is kept. */
#ifndef DRIVEID_ESTIMATE_FSM_STATE_H
#define DRIVEID_ESTIMATE_FSM_STATE_H

#include <driveid/estimate.h>
#include <driveid/monitor.h>

#include "base/bank.h"
#include "fsm_low.h"

#define FSM_STAGES (1 + FSM_LOW)
#define FSM_LANES 6          /* stages in the sums, made even for the compiler's vectors */
#define FSM_STAGE_RATIO 5.0
#define FSM_COARSE_FIRST 1.5 /* coarse row of the first stage, of the others: times 1/bandwidth */
#define FSM_COARSE_LATER 4.0
#define FSM_LAGS 16          /* lag 0 .. 15 of coarse rows */
#define FSM_MOTION_S 0.3     /* how far back motion is looked at */
#define FSM_PAUSE 0.02       /* of its usual mean square: too little to forget */
#define FSM_REST 1e-3        /* and to learn from */
#define FSM_HOLD_S 0.5       /* theta is held so long after an alarm */
#define FSM_WATCHED 1        /* stage whose residual is watched */
#define FSM_COLUMNS_MAX (DRIVEID_THETA_MAX + DRIVEID_ORDER_MAX + 1)
#define FSM_POOL 16384       /* numbers; configure refuses what does not fit */
#define FSM_PAIRS(n) ((n) * ((n) + 1) / 2) /* lower triangle: pair (i, j <= i) stands at FSM_PAIRS(i) + j */

typedef struct fsm_equation {
    uint8_t params, order, columns;          /* columns = params + order + 1, the last one is y */
    int8_t param[DRIVEID_THETA_MAX];         /* theta index of each column */
    uint8_t place[DRIVEID_THETA_MAX];        /* column of each theta index */
    uint8_t known;                           /* 1: it has known terms */
    int8_t output;                           /* column that carries the highest derivative, -1: it is known */
} fsm_equation;

typedef struct driveid_svf_common {
    driveid_regression regression;
    driveid_estimator_options options;       /* resolved: nothing zero */
    fsm_equation equation[DRIVEID_EQUATIONS_MAX];
    uint8_t stages, sections;
    uint8_t running;                         /* filters are started */
    uint8_t gap_told;                        /* the next sample comes after a gap, however short */
    int8_t chosen[DRIVEID_EQUATIONS_MAX];    /* stage of the last answer, -1: none */
    int64_t first_ns, segment_ns, last_ns, row_ns, last_row_ns, solve_ns, last_solve_ns, gap_ns;
    int64_t restart_ns;                      /* stamp of the last restart by alarm */
    uint64_t samples;
    uint8_t forgetting_paused;               /* nothing new is learnt about some motion: nothing is forgotten */
    uint8_t resting;                         /* no motion at all: rows are not added */
    uint8_t watched;                         /* there is an answer whose residual can be watched, confirmed or not */
    uint32_t motion_mask;                    /* parameters whose column is a derivative */
    double motion[DRIVEID_THETA_MAX];        /* recent mean square of their columns */
    driveid_monitor monitor[DRIVEID_EQUATIONS_MAX];
    driveid_status status;                   /* of answer */
    driveid_estimate answer;
    uint32_t confirmed_mask, confirmed_restarts;                       /* parameters that are trusted, since which restart */
    uint8_t agreed[DRIVEID_THETA_MAX];                                 /* answers in a row */
    double first_theta[DRIVEID_THETA_MAX], first_half[DRIVEID_THETA_MAX]; /* of those that are not yet: what they must agree with */
} driveid_svf_common;

#include "base/real_f64.h"
#include "fsm_decl.inc"
#include "base/real_f32.h"
#include "fsm_decl.inc"

#endif
