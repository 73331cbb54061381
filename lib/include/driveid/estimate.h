/* SPDX-License-Identifier: Apache-2.0 */
/* Estimate and estimator: what every on-line method gives, and the one interface that runs any of them.
 *
 * Purpose   parameters of a drive's equations (regression.h) with 95 % interval and validity, sample by sample, for months; method and number type by name.
 * Model     sum of factor * theta * d^k channel = 0, each equation behind the same filters; initial conditions unknown [EQ FSM-3].
 * Method    "fsm": frequency shifting in its economical form, docs/theory/frequency-shifting.md: filter bank with exact holds, prefilters of which
 *           each equation takes the best, scaled solve with rank, the highest derivative solved for through instruments [EQ FSM-39]; forgetting,
 *           rest, gaps, residual alarm with restart [LONG-RUN]. Its full form, with c from time zero, is fsm.h.
 *           "window", "discrete": the last N samples weighed by integrals (Oueslati) or by sums in q (Fliess; block by block: discrete.h) that vanish at both ends of a
 *           window of several lengths; rows accumulate. O(window): N multiply-adds a term in the sample that takes a row, every N/8; the O(1) recursion drifts and is not used.
 *           "rls", "kalman": baselines on the same filters: square-root least squares with directional forgetting; a random walk of the parameters
 *           (Joseph's form, no forgetting factor). Both are biased by noise of the differentiated channel; the bound is in their interval.
 *           "adm": algebraic derivative, an unstable baseline; forgetting_s after its start it switches off: DRIVEID_FROZEN, theta held. "frequency": one or two sinusoids: frequency.h.
 * Parameters  SI. options.dt_s is needed, all others may be zero.
 * Returns   update: the status of the answer after this sample, or
 *             DRIVEID_NOT_YET   too little since start or alarm        DRIVEID_FROZEN     the drive rests: theta held, nothing learnt
 *             DRIVEID_GAP       silence beyond gap_s: filters restarted, what was learnt is kept
 *             DRIVEID_DUPLICATE, DRIVEID_ERR_TIME, DRIVEID_ERR_VALUE   the sample was ignored, nothing changed
 *           estimate: see driveid_estimate below. configure: DRIVEID_ERR_CONFIG and a sentence, DRIVEID_ERR_CAPACITY: storage too small.
 * Fixed point  fsm, window, discrete, rls: per unit of options.range in Q30, coefficients Q31, rows int32, sums Q46 in int64, rounding; saturations
 *           of readings counted (driveid_estimator_saturations), a row beyond its scale left out. One sample time. Orders that rounding rules out are refused.
 * Cost      docs/benchmark-estimator.md: fsm below half a microsecond a sample at 1 kHz for two parameters, solves included; state up to 163 kB, of which a rigid axis touches about 25 kB; stack of an update below 25 kB (of a q31 window's configure 36 kB). Many drives: fleet.h.
 * Accuracy  docs/intervals.md (coverage, width over the Cramer-Rao bound); tests/property: online_test, excitation_test, day_test; f32 against
 *           f64 within a quarter of the interval's half-width (tests/unit/estimator_test.cpp). */
#ifndef DRIVEID_ESTIMATE_H
#define DRIVEID_ESTIMATE_H

#include <stddef.h>
#include <stdint.h>

#include <driveid/regression.h>
#include <driveid/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/* One trustworthy answer. With DRIVEID_OK every parameter is valid. With DRIVEID_WEAK_EXCITATION and DRIVEID_RANK it is written too:
 * use theta[k] only where bit k of valid_mask is set; weak_mask names the parameters that these data cannot give; one in neither is not confirmed yet. With DRIVEID_FROZEN the
 * answer from before the rest is written, with the stamp it belongs to. With any other status nothing is written. */
typedef struct driveid_estimate {
    int64_t t_ns;                      /* instant it belongs to */
    int64_t first_ns;                  /* stamp of the first sample behind it */
    int64_t first_trusted_ns;          /* stamp of the first valid estimate since the last restart */
    uint32_t samples;                  /* effective number behind it */
    uint32_t restarts;                 /* residual alarms so far */
    uint32_t params;
    uint32_t valid_mask;               /* bit k: theta[k] is trustworthy: its first values have been confirmed by those after them */
    uint32_t weak_mask;                /* bit k: theta[k] cannot be had from these data */
    double theta[DRIVEID_THETA_MAX];   /* SI */
    double lo[DRIVEID_THETA_MAX];      /* 95 % interval */
    double hi[DRIVEID_THETA_MAX];
    double cov[DRIVEID_THETA_MAX * DRIVEID_THETA_MAX]; /* row-major params x params, for propagation to physical parameters */
    double residual_rms;               /* of the filtered equation error, SI of equation 0 */
    double condition;                  /* of the scaled normal matrix */
} driveid_estimate;

typedef enum driveid_real { DRIVEID_F64 = 0, DRIVEID_F32 = 1, DRIVEID_Q31 = 2 } driveid_real;

typedef struct driveid_estimator_options {
    double dt_s;           /* nominal sample time; the true one comes from the stamps */
    double bandwidth_rad_s;/* of the filter bank; 0: chosen from dt_s */
    double forgetting_s;   /* memory of the long-running scheme; 0: default 10 s; INFINITY: never forget; adm: when it switches off */
    double answer_s;       /* time between solves; 0: 20 ms, or 3/bandwidth where that is longer */
    double gap_s;          /* a longer silence is a gap; 0: 5 dt_s */
    double alarm;          /* residual alarm threshold (monitor.h); 0: default, < 0: never restart */
    double model_error;    /* relative error that no statistics of the record can see (a sign between stamps, kinks of a current): its share of
                              the parameter, or a third of its share of the equation's largest term, is added in squares to each half-width;
                              0: as the regression suggests, < 0: none */
    double range[DRIVEID_CHANNELS_MAX]; /* q31: declared |channel| range, SI */
} driveid_estimator_options;

/* Caller-owned storage for any method; no self-pointers, so a copy is a snapshot. */
typedef struct driveid_estimator driveid_estimator;

#define DRIVEID_ESTIMATOR_BYTES 180000 /* enough for any method and type: union { double align; unsigned char bytes[...]; } */

/* Bytes needed for (method, type); 0 where that pair does not exist. */
size_t driveid_estimator_size(const char *method, driveid_real type);

#define DRIVEID_ESTIMATOR_METHODS "choose fsm, rls, window, discrete or frequency in f64, f32 or q31, kalman or adm in f64 or f32"

/* method: see Method above. DRIVEID_ERR_CONFIG with a sentence in reason[reason_size] where it is refused. */
driveid_status driveid_estimator_configure(driveid_estimator *self, size_t size, const char *method, driveid_real type,
                                           const driveid_regression *regression,
                                           const driveid_estimator_options *options, char *reason, size_t reason_size);

/* channel[regression.channels], SI. */
driveid_status driveid_estimator_update(driveid_estimator *self, int64_t t_ns, const double *channel);
/* Costs a copy: update keeps the answer current (every 20 ms, or every 3/bandwidth where that is longer). */
driveid_status driveid_estimator_estimate(const driveid_estimator *self, driveid_estimate *out);
/* Samples are known to be lost before the next one: it is taken as the first after a gap, however short the silence. */
void driveid_estimator_gap(driveid_estimator *self);
void driveid_estimator_restart(driveid_estimator *self);

/* q31 only: samples as a converter gives them, value / range * 2^30 (a channel of which only derivatives are used may wrap). The same numbers
 * as update gives, bit by bit, on host and target. */
driveid_status driveid_estimator_update_counts(driveid_estimator *self, int64_t t_ns, const int32_t *count);
/* q31: readings beyond their range and clipped filter states so far, which bend the parameters (rows left out do not). 0 for the other types. */
uint32_t driveid_estimator_saturations(const driveid_estimator *self);

#ifdef __cplusplus
}
#endif
#endif
