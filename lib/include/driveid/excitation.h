/* SPDX-License-Identifier: Apache-2.0 */
/* The best sinusoid to excite a resonance with: x'' + 2 zeta w0 x' + w0^2 x = A sin(Z w0 t), x measured with white noise.
 *
 * Purpose   how well w0 and zeta can be known after a given time, as a function of the frequency ratio Z, and the Z to take.
 * Method    driveid_excitation_bound: the Cramer-Rao bound from the exact sensitivities of x (from rest), integrated with the motion.
 *           driveid_excitation_variance: the variance of recursive least squares for w0^2 alone on undamped motion [Oueslati 2011, (11)-(13); the
 *           printed (12) has one omega_0 too many]. The paper's optimum Z = 1 holds for it only beyond some four periods; for 100 samples
 *           it is Z = 3.1, and lambda = 1 is always best.
 * Returns   DRIVEID_OK; DRIVEID_ERR_ARGUMENT. Cost: a few operations a sample; suggest: 123 bounds.
 * Accuracy  tests/paper/oueslati.cpp: NOTES' optima; the bound against sensitivities of a motion integrated there, to 1 %. */
#ifndef DRIVEID_EXCITATION_H
#define DRIVEID_EXCITATION_H

#include <driveid/status.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct driveid_excitation {
    double omega_0_rad_s, zeta;  /* > 0; 0 .. 1 */
    double amplitude;            /* A, of the acceleration: force over mass */
    double sigma;                /* standard deviation of the noise of x */
    double dt_s, span_s;         /* sample time, time for the experiment: at most 1e6 samples */
} driveid_excitation;

/* Relative standard deviations that no unbiased estimator goes below. */
driveid_status driveid_excitation_bound(const driveid_excitation *self, double ratio, double *omega_0, double *zeta);

/* Variance of the estimate of w0^2 by recursive least squares with forgetting factor lambda a sample. */
driveid_status driveid_excitation_variance(const driveid_excitation *self, double ratio, double lambda, double *variance);

/* The ratio in 0.1 .. 10 with the smallest bound on w0, and that bound. */
driveid_status driveid_excitation_suggest(const driveid_excitation *self, double *ratio, double *omega_0);

#ifdef __cplusplus
}
#endif
#endif
