/* SPDX-License-Identifier: Apache-2.0 */
/* Frequencies of a biased signal of one or two sinusoids, for vibration and torque ripple.
 *
 * Purpose   omega_1 (and omega_2) of  y = K + A_1 sin(omega_1 t + phi_1) [+ A_2 sin(omega_2 t + phi_2)]  on line, from a fraction of a period on.
 * Model     y''' + w1^2 y' = 0, or y^(5) + (w1^2 + w2^2) y''' + w1^2 w2^2 y' = 0: linear in theta, with bias, amplitudes and phases as initial
 *           conditions, which every method of estimate.h removes [Kasac 2018, Example 1; Trapero, Sira-Ramirez, Batlle 2007].
 * Method    driveid_frequency_regression() gives the regression; run any method on its one channel: "discrete" and "window" take the noise's moments off
 *           (total least squares), "fsm" chooses filters that fit it; "rls" and "kalman" are biased. driveid_frequency_read() gives omega from theta.
 *           On line, for months: the method "frequency" (estimate.h, the daemon's), "discrete" with q taken back to omega exactly, and beside it the
 *           amplitudes, fitted at the frequencies found over five periods (half a second at least). Its theta: f_1 in Hz, amplitude 1, f_2, amplitude 2.
 *           A sinusoid is valid while its amplitude stands out by five deviations; one that vanishes is waited for, and one that comes back at its frequency is known when its amplitude is;
 *           one whose phase turns away from its frequency is a new one: a restart, and half a second to a second until it is known.
 * Returns   read: DRIVEID_OK; DRIVEID_RANK where theta has no positive roots (one sinusoid only, or noise): nothing is written.
 * Fixed point, gaps, intervals: those of the method. Bandwidth: five times the highest omega. In "frequency" the interval of f is widened by what the
 *           fitted phase turns; a frequency that drifts by 0.1 % a second is followed within it, one that drifts faster needs a shorter forgetting_s.
 * Accuracy  tests/paper/frequency.cpp: against the Cramer-Rao bound of a sinusoid in white noise, coverage over seeds. tests/unit/tones_test.cpp: "frequency". */
#ifndef DRIVEID_FREQUENCY_H
#define DRIVEID_FREQUENCY_H

#include <driveid/estimate.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct driveid_frequency {
    uint32_t sinusoids;
    double omega_rad_s[2], lo_rad_s[2], hi_rad_s[2]; /* rising; 95 % interval */
} driveid_frequency;

/* sinusoids 1 or 2; omega_rad_s: the highest one that is expected, gives the bandwidth; 0 leaves it to the method. */
driveid_status driveid_frequency_regression(uint32_t sinusoids, double omega_rad_s, driveid_regression *out);
driveid_status driveid_frequency_read(const driveid_estimate *estimate, driveid_frequency *out);

#ifdef __cplusplus
}
#endif
#endif
