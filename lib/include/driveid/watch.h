/* SPDX-License-Identifier: Apache-2.0 */
/* Watch: the loaded model runs beside the drive. Does it still explain it, and if not, since when, where, and which effect would?
 *
 * Purpose   "the model no longer explains this drive", with the likely effect of the catalogue, a few seconds of motion after it came.
 * Model     the mechanical equation of an on-line model (model.h) with parameters theta_0: those of the model file, or, where the file has none, those
 *           that the estimator found first. Residual r = y - phi theta_0, of the same invariant filters as the estimator's.
 * Method    innovation test: mean square of r against its usual level, by the residual monitor (monitor.h), over all rows and by regime. The on-line
 *           form of the catalogue: the columns of every linear effect are extra channels through the same filters; with sums that forget, what each
 *           would take of r'r is known at any time. Effects that belong to a parameter of the model (inertia_change, friction_drift) take its own
 *           column, delay takes the derivative of the driving channel. A mismatch needs a gain beyond chance (a t statistic over correlated rows), beyond
 *           what theta_0 may be off by (the intervals of the file or of the answer it was taken from, at least 0.5 % of the largest term), and for a
 *           while; its name is that of the plainest effect (a change of the model's own parameters, then fewest columns) among those whose likelihoods the recent motion does not tell apart.
 * Parameters  SI.
 * Returns   driveid_watch_init: DRIVEID_OK; DRIVEID_ERR_CONFIG where the structure has no mechanical equation (nothing is watched then).
 * Cost      a sample: four multiply-adds for each column (about 160 for a rotary axis), about three times the estimator's (docs/benchmark-estimator.md); none while the drive rests. State about 65 kB.
 * Accuracy  tests/property/watch_test.cpp (8 hours without a false alarm), tests/daemon/test_watch.py (each change named within 10 s of motion). */
#ifndef DRIVEID_WATCH_H
#define DRIVEID_WATCH_H

#include <stddef.h>

#include <driveid/model.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum driveid_watch_regime {
    DRIVEID_WATCH_STANDSTILL = 0, /* below a twentieth of the usual speed */
    DRIVEID_WATCH_SLOW,           /* below a third of it */
    DRIVEID_WATCH_ACCELERATING,
    DRIVEID_WATCH_BRAKING,
    DRIVEID_WATCH_STEADY,         /* at speed, hardly accelerating */
    DRIVEID_WATCH_REGIMES
} driveid_watch_regime;

const char *driveid_watch_regime_name(driveid_watch_regime regime);

#define DRIVEID_WATCH_TIES 4

typedef struct driveid_watch_report {
    uint8_t ready;                 /* theta_0 and a usual level are there */
    uint8_t mismatch;              /* the model no longer explains the drive */
    int64_t since_ns;              /* of the mismatch */
    const char *effect;            /* canonical name, "unknown" where none of the catalogue fits, NULL: no mismatch */
    double order;                  /* of a periodic effect, else 0 */
    double share;                  /* of what is beyond the reference's spread, in r'r */
    uint32_t ties;
    const char *tie[DRIVEID_WATCH_TIES]; /* other effects that the recent motion does not tell from it */
    driveid_watch_regime regime;   /* that holds most of the excess */
    double rms, usual_rms;         /* of r, recent and usual, SI of the equation */
    uint8_t skew_known;            /* the motion of the last minute tells it within a quarter of a sample time, either way */
    double skew_s, skew_half_s;    /* readings of the driving signal are older than their stamps by this, beside those of the motion; half of the 95 % interval */
} driveid_watch_report;

/* Caller-owned storage of driveid_watch_size() bytes, aligned as a double; no self-pointers: a copy is a snapshot. */
typedef struct driveid_watch driveid_watch;

size_t driveid_watch_size(void);

/* online: as the estimator has it. dt_s: nominal sample time. */
driveid_status driveid_watch_init(driveid_watch *watch, const driveid_online *online, double dt_s);

/* Every sample, in order. */
void driveid_watch_sample(driveid_watch *watch, const driveid_sample *sample);

/* Samples are known to be lost before the next one. */
void driveid_watch_gap(driveid_watch *watch);

/* The estimator's answer, where it is new: it becomes the reference where there is none, and once a mismatch that is a change of the model's own
 * parameters, or unknown, is explained by them alone. */
void driveid_watch_estimate(driveid_watch *watch, const driveid_estimate *estimate, driveid_status status);

const driveid_watch_report *driveid_watch_answer(const driveid_watch *watch);

#ifdef __cplusplus
}
#endif
#endif
