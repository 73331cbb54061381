/* SPDX-License-Identifier: Apache-2.0 */
/* How a watch is laid out.
 *
 *   sample -> channels (online) -> bank of the equation's channels, low-pass of the candidates' columns -> row -> sums that forget -> verdict
 *
 * A row has the base columns (the equation's unknown terms, then y) and the candidates' columns z. Kept are base x base, z x base and z x z within
 * each candidate: enough for what any candidate would take of the residual, at any theta. */
#ifndef DRIVEID_ESTIMATE_MODEL_WATCH_STATE_H
#define DRIVEID_ESTIMATE_MODEL_WATCH_STATE_H

#include <driveid/monitor.h>
#include <driveid/watch.h>

#include "base/bank.h"
#include "model_watch_filter.h"

#define WATCH_CANDIDATES 96
#define WATCH_BASE 10          /* unknown terms of the mechanical equation, and y */
#define WATCH_EACH 3           /* columns of one candidate */
#define WATCH_MEMORY_S 5.0     /* of motion */
#define WATCH_LOOK_S 0.1
#define WATCH_ORDERS 48        /* highest order per turn of cogging; half of it for ripple */

/* An effect as extra columns. */
typedef struct watch_candidate {
    uint8_t effect;            /* index in the catalogue */
    uint8_t columns, first;
    uint8_t own;               /* 1: a change of what the model has */
    uint8_t product;           /* 1: of the torque and something else */
    double order;
    double shape[DRIVEID_EFFECT_SHAPES_MAX];
} watch_candidate;

/* A column that is a derivative of a channel of the equation. */
typedef struct watch_tap { uint8_t column, channel, derivative; double factor; } watch_tap;

#define WATCH_GROUPS 10
#define WATCH_SKEW (WATCH_BASE + 3)

typedef struct watch_skew {
    uint8_t terms, group;      /* 0 terms: not looked at */
    uint8_t column[3];         /* of z, after the base columns; the slope of the driving signal is the last one */
    double motion_s, block_s;
    double sum[WATCH_GROUPS][WATCH_SKEW][WATCH_SKEW]; /* lower halves; y is the last row */
} watch_skew;

struct driveid_watch {
    driveid_online online;     /* with speed, whatever the model needs */
    uint8_t params;            /* base columns: these and y */
    uint8_t place[DRIVEID_THETA_MAX];     /* base column of each theta, params where it is not in the equation */
    uint8_t candidates, columns, taps;
    uint8_t periodic;          /* first candidate that is an order per turn of cogging or ripple */
    uint8_t cogging, ripple;   /* first columns of their orders */
    uint8_t has_reference, from_file, running, asleep;
    uint8_t motion_channel, motion_derivative;
    watch_candidate candidate[WATCH_CANDIDATES];
    watch_tap tap[4];
    double reference[WATCH_BASE], sigma[WATCH_BASE]; /* by base column: value and its standard deviation */
    int64_t last_ns, start_ns, last_row_ns, row_ns, settle_ns, first_over_ns;
    double still_s, look_s, motion_s, over_s, unnamed_s, calm_s, name_s;
    int said;                  /* candidate whose name the report has, -1: none */
    int name;                  /* candidate that takes most (-1: none), the same for name_s of motion */
    uint8_t named_before;      /* by rows that the sums no longer have */
    uint32_t estimates;        /* behind a learnt reference */
    double young_s;            /* of motion since the reference was taken from the estimator */
    double speed2, accel2;     /* usual squares of filtered speed and acceleration in motion */
    driveid_monitor monitor;
    double weight;
    double regime_r2[DRIVEID_WATCH_REGIMES], regime_weight[DRIVEID_WATCH_REGIMES], regime_usual[DRIVEID_WATCH_REGIMES];
    double bb[WATCH_BASE][WATCH_BASE];
    double zb[WATCH_BASE][WATCH_COLUMNS];
    double zz[WATCH_EACH][WATCH_COLUMNS]; /* zz[d][i]: column i times column i + d */
    double dt_s;
    watch_skew skew;
    driveid_watch_report report;
    driveid_bank_f64 base;
    watch_filter column;
};

/* Candidates and their columns, from the catalogue. */
void watch_list(driveid_watch *watch);
/* Values of the columns at the sample in use, before the low-pass. */
void watch_fill(const driveid_watch *watch, double *column);

/* What the sums say at theta (by base column). */
typedef struct watch_finding {
    double r2, drive2;         /* mean squares of the residual and of the equation's largest term */
    int best;                  /* candidate, -1: none beyond chance */
    double share, size2;       /* of r'r beyond the reference's spread; mean square of what it takes */
    int said;                  /* candidate of the name that the report has, where it is not told from the best, else -1 */
    double said_share;
    int open;                  /* another one would take more, and is not yet told from an error of the reference */
    unsigned ties;
    uint8_t tie[DRIVEID_WATCH_TIES]; /* effects that the sums do not tell from it */
} watch_finding;

/* The same effect, and order where it has one. */
int watch_alike(const driveid_watch *watch, int a, int b);

void watch_skew_init(driveid_watch *watch);
void watch_skew_clear(driveid_watch *watch);
void watch_skew_row(driveid_watch *watch, const double *row, const double *z, double dt_s);

watch_finding watch_find(const driveid_watch *watch, const double *theta);

#endif
