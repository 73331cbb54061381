/* SPDX-License-Identifier: Apache-2.0 */
/* Continuous-time transfer functions from sampled records: y^(n) + sum a_i y^(i) = sum b_j u^(j)(t - delay).
 *
 * Purpose   the off-line identification a user expects: least squares, total least squares, instrumental variables, refined
 *           instrumental variables (SRIVC) with order and delay search, output error with covariance; then poles, zeros, damping,
 *           Bode data and conversion between s, z and q forms.
 * Method    every signal passes 1/F(s); the filter's states are the filtered derivatives. u is filtered exactly for its hold. y is known at its
 *           samples only: it is first filtered along straight lines, which is wrong by about (omega T_s)^2/12, and then mended with the
 *           estimate, whose response between the samples is known, and fitted again until nothing changes: without noise every method
 *           is exact where u is held as stated. F is a state-variable filter (s + lambda)^n for LS, TLS and IV, and the estimate's own
 *           A(s), repeated to convergence, for SRIVC (Young and Jakeman 1980; Garnier and Wang 2008). TLS weighs the columns of y with the
 *           covariance that white noise on y gives them and takes those of u as exact. Unknown initial conditions are n further
 *           regressors s^i/F [EQ FSM-3]. Solves by QR; no normal equations. OE: Gauss-Newton with step control on the simulated output,
 *           started from SRIVC.
 * Covariance SRIVC and OE: sigma^2 (Z'Z)^-1 on noise-free regressors, efficient for white output noise; LS, TLS, IV: sandwich with the
 *           scores' autocorrelation. LS is biased by output noise: its distance from TLS is added to its covariance, so the interval
 *           grows with the bias but stays centred on a wrong value; prefer SRIVC. A u that is not held as stated (average, jitter) is
 *           an error of the model that no interval holds.
 * Memory    allocates while it runs; thread-safe.
 * Accuracy  tests/paper/lti.cpp: all five methods within 1e-6 without noise; intervals of all five at 1 and 5 % noise; within
 *           10 % of the Cramer-Rao bound for SRIVC and OE; the peers' table of NOTES B1. */
#ifndef DRIVEID_LTI_H
#define DRIVEID_LTI_H

#include <stddef.h>

#include <driveid/sample.h>
#include <driveid/status.h>

#ifdef __cplusplus
extern "C" {
#endif

#define DRIVEID_LTI_ORDER_MAX 8

typedef enum driveid_lti_method {
    DRIVEID_LTI_LS = 0,
    DRIVEID_LTI_TLS,
    DRIVEID_LTI_IV,
    DRIVEID_LTI_SRIVC,
    DRIVEID_LTI_OE
} driveid_lti_method;

typedef struct driveid_lti_task {
    size_t order;                 /* n, 1 .. 8 */
    size_t zeros;                 /* degree of B, 0 .. n-1 */
    size_t delay;                 /* of u, in samples */
    double T_s;                   /* sampling interval, s */
    size_t rows;
    const double *y, *u;          /* [rows] */
    driveid_hold hold;            /* of u; y is taken as smooth */
    int initial_conditions;       /* 0: the record starts from rest; 1: n unknowns more */
    driveid_lti_method method;
    double bandwidth_rad_s;       /* lambda of the state-variable filter; 0: chosen from the spectrum of y */
} driveid_lti_task;

typedef struct driveid_lti_model {
    size_t order, zeros, delay;
    double T_s;
    double a[DRIVEID_LTI_ORDER_MAX];      /* a_0 .. a_(n-1) */
    double b[DRIVEID_LTI_ORDER_MAX];      /* b_0 .. b_zeros */
    double cov[4 * DRIVEID_LTI_ORDER_MAX * DRIVEID_LTI_ORDER_MAX]; /* row-major (n+zeros+1)^2 over (a, b) */
    double noise_sd;                      /* of the output error, unit of y */
    double fit_percent;                   /* 100 (1 - |y - y_sim| / |y - mean|) in free run */
    double bic;                           /* N ln(mse) + k ln N: smaller is better */
    size_t iterations;
    int converged;
} driveid_lti_model;

/* DRIVEID_OK; DRIVEID_ERR_ARGUMENT; DRIVEID_ERR_DATA (record shorter than ten unknowns, not finite, y or u constant); DRIVEID_RANK. */
driveid_status driveid_lti_fit(const driveid_lti_task *task, driveid_lti_model *model);

/* Best (order, zeros, delay) by BIC over order 1 .. task->order, zeros 0 .. order-1 (at most task->zeros), delay 0 .. delay_max; at least
 * 10 has to be gained in BIC for a larger model. task->delay is ignored. */
driveid_status driveid_lti_search(const driveid_lti_task *task, size_t delay_max, driveid_lti_model *best);

typedef struct driveid_lti_modes {
    size_t poles, zeros;
    double pole_re[DRIVEID_LTI_ORDER_MAX], pole_im[DRIVEID_LTI_ORDER_MAX]; /* rad/s, by |s| */
    double omega_rad_s[DRIVEID_LTI_ORDER_MAX], omega_half[DRIVEID_LTI_ORDER_MAX]; /* natural frequency and half of its 95 % interval */
    double zeta[DRIVEID_LTI_ORDER_MAX], zeta_half[DRIVEID_LTI_ORDER_MAX];         /* damping ratio, likewise */
    double zero_re[DRIVEID_LTI_ORDER_MAX], zero_im[DRIVEID_LTI_ORDER_MAX];
    double gain, gain_half;                                                /* b_0 / a_0 */
} driveid_lti_modes;

/* Delta method on the covariance. DRIVEID_ERR_NUMERIC where a_0 is zero. */
driveid_status driveid_lti_modes_of(const driveid_lti_model *model, driveid_lti_modes *modes);

/* H(j omega) with delay: re[count], im[count]. */
driveid_status driveid_lti_frequency(const driveid_lti_model *model, size_t count, const double *omega_rad_s, double *re, double *im);

/* Held-input equivalent: (z^n + sum az_i z^i) y = (sum bz_i z^i) u, az[n], bz[n]. */
driveid_status driveid_lti_to_z(const driveid_lti_model *model, double T_s, double *az, double *bz);

/* Back; DRIVEID_ERR_NUMERIC where a root in z is on the negative real axis or zero (no real s form at this T_s). */
driveid_status driveid_lti_from_z(size_t order, const double *az, const double *bz, double T_s, driveid_lti_model *model);

/* Tustin domain q = (2/T)(z-1)/(z+1), normalised to A(0) = 1: Aq[n] = A_1 .. A_n, Bq[n+1] = B_0 .. B_n. */
driveid_status driveid_lti_z_to_q(size_t order, const double *az, const double *bz, double T_s, double *Aq, double *Bq);

#ifdef __cplusplus
}
#endif
#endif
