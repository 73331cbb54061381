/* SPDX-License-Identifier: Apache-2.0 */
/* Frequency shifting in its full form: a, b and the initial-condition parameters c of an n-th order equation, from time zero.
 *
 * Purpose   y^(n) + sum a_i y^(i) = sum b_j u^(j) on line, free of initial conditions, within a fraction of the slowest time constant. For
 *           running on and on take driveid_estimator (estimate.h), the economical form of the same idea.
 * Model     [EQ FSM-1], c of [EQ FSM-3]; coefficients that are known to be zero can be left out (fixed_mask).
 * Method    Kasac, Majetic, Brezak 2018. The n-th difference in s with step q kills the initial conditions [EQ FSM-16], n + m + 1 shifts
 *           by l q make as many rows [EQ FSM-23], 1/D(s) makes them realisable [EQ FSM-25], S = sum phi phi' is solved scaled, with
 *           rank [EQ FSM-39]; c by the lower differences [EQ FSM-41] (its last index is l; gamma in [EQ FSM-44] takes i).
 *           Realised time-invariant: x_p = e^-pqt X_p, X_p' = -(q_k - p q) X_p + y, weights by exp() outside. Cascade of unit-gain
 *           sections, one exact lower-triangular transition a shift, s^i/D by Newton combination.
 * Parameters  driveid_fsm_suggest offers poles and q. poles: rad/s, each above p_max q with p_max = 2 n + m (autonomous: 2 n - 1), or configure refuses: a section would grow.
 *           Storage is the caller's; no self-pointers: a copy is a snapshot.
 * Returns   DRIVEID_OK; configure: DRIVEID_ERR_CONFIG with a sentence; update: DRIVEID_ERR_TIME, _VALUE, DRIVEID_DUPLICATE (sample ignored);
 *           estimate: DRIVEID_NOT_YET before there are rows, DRIVEID_RANK where the rows do not tell all apart (nothing written).
 * Cost      a sample: (p_max + 1) poles (poles + 1) multiply-adds for two channels, one exp(); a new dt: p_max + 1 small matrix exponentials.
 * Accuracy  tests/paper/kasac.cpp: Tables 1 and 2 and Example 3 of the paper; f64 to 1e-9, f32 to 1e-3 on Example 2. */
#ifndef DRIVEID_FSM_H
#define DRIVEID_FSM_H

#include <stddef.h>
#include <stdint.h>

#include <driveid/sample.h>
#include <driveid/status.h>

#ifdef __cplusplus
extern "C" {
#endif

#define DRIVEID_FSM_ORDER_MAX 6
#define DRIVEID_FSM_POLES_MAX 8
#define DRIVEID_FSM_SHIFTS_MAX (3 * DRIVEID_FSM_ORDER_MAX + 1)
#define DRIVEID_FSM_COLUMNS_MAX (2 * DRIVEID_FSM_ORDER_MAX + 2)
#define DRIVEID_FSM_AUTONOMOUS 255

typedef struct driveid_fsm_config {
    uint8_t order;       /* n, 1 .. 6 */
    uint8_t zeros;       /* m, 0 .. n; DRIVEID_FSM_AUTONOMOUS: no input */
    uint8_t fixed_mask;  /* bit i: a_i is known to be zero */
    uint8_t poles;       /* n + 1 .. 8 */
    uint8_t hold_y, hold_u; /* driveid_hold: FIRST is a straight line here */
    double pole_rad_s[DRIVEID_FSM_POLES_MAX]; /* equal ones are allowed */
    double q_per_s;      /* shift */
} driveid_fsm_config;

typedef struct driveid_fsm_estimate {
    double a[DRIVEID_FSM_ORDER_MAX], b[DRIVEID_FSM_ORDER_MAX + 1], c[DRIVEID_FSM_ORDER_MAX];
    double condition;    /* of the scaled normal matrix, from its pivots */
    double t_s;          /* since the first sample */
} driveid_fsm_estimate;

#define DRIVEID_FSM_TYPE(REAL_, NAME_)                                                                                       \
    typedef struct NAME_ {                                                                                                   \
        driveid_fsm_config config;                                                                                           \
        uint8_t shifts, rows, unknowns, started;                                                                             \
        int64_t first_ns, last_ns, dt_ns;                                                                                    \
        double last[2];                                                                                                      \
        REAL_ gain[DRIVEID_FSM_SHIFTS_MAX];                                                                                  \
        REAL_ step[DRIVEID_FSM_SHIFTS_MAX][DRIVEID_FSM_POLES_MAX][DRIVEID_FSM_POLES_MAX + 2];                                \
        REAL_ v[DRIVEID_FSM_SHIFTS_MAX][3][DRIVEID_FSM_POLES_MAX]; /* y, u, and for shift 0 the impulse */                    \
        double row[DRIVEID_FSM_ORDER_MAX * 2 + 1][DRIVEID_FSM_COLUMNS_MAX]; /* last rows: active a, b, then y */             \
        double s[DRIVEID_FSM_COLUMNS_MAX * DRIVEID_FSM_COLUMNS_MAX];                                                         \
        double s_c[(2 * DRIVEID_FSM_COLUMNS_MAX) * (2 * DRIVEID_FSM_COLUMNS_MAX)];                                           \
    } NAME_

DRIVEID_FSM_TYPE(double, driveid_fsm_f64);
DRIVEID_FSM_TYPE(float, driveid_fsm_f32);

/* poles, pole_rad_s and q_per_s from the sample time, the signals' bandwidth (of what is to be identified: the highest resonance or corner) and the noise
 * of y over its rms; order, zeros, fixed_mask and holds are the caller's. DRIVEID_ERR_CONFIG with a sentence where the sample time is too long. */
driveid_status driveid_fsm_suggest(driveid_fsm_config *config, double dt_s, double bandwidth_rad_s, double noise, char *reason, size_t reason_size);

driveid_status driveid_fsm_configure_f64(driveid_fsm_f64 *self, const driveid_fsm_config *config, char *reason, size_t reason_size);
driveid_status driveid_fsm_configure_f32(driveid_fsm_f32 *self, const driveid_fsm_config *config, char *reason, size_t reason_size);

/* u is ignored where there is no input. */
driveid_status driveid_fsm_update_f64(driveid_fsm_f64 *self, int64_t t_ns, double y, double u);
driveid_status driveid_fsm_update_f32(driveid_fsm_f32 *self, int64_t t_ns, double y, double u);

driveid_status driveid_fsm_estimate_f64(const driveid_fsm_f64 *self, driveid_fsm_estimate *out);
driveid_status driveid_fsm_estimate_f32(const driveid_fsm_f32 *self, driveid_fsm_estimate *out);

#ifdef __cplusplus
}
#endif
#endif
