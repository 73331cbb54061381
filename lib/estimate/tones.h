/* SPDX-License-Identifier: Apache-2.0 */
/* Method "frequency" [frequency.h]: what turns the squares of one or two frequencies into f and amplitude of each sinusoid.
 *
 *   samples -> discrete (fixed sums, noise's moments off) -> omega^2 -> omega -> phases -> least squares of bias, cosines and sines -> amplitude
 *
 * The rows of "discrete" hold q = (2/T) tanh(sT/2) for s: for a sinusoid that is known exactly, omega = (2/T) atan(T/2 sqrt(theta)).
 * Amplitudes are fitted at the frequencies found, over a short memory, with phases that run on from sample to sample: a wrong frequency turns away
 * from the signal and loses its amplitude, so an amplitude that stands out is the check of both. A slow turn of the fitted phase widens the interval of f; a
 * fast one, or a signal that the fit no longer explains though it is there, is a changed frequency: all begins anew. One that vanishes is waited for. */
#ifndef DRIVEID_ESTIMATE_TONES_H
#define DRIVEID_ESTIMATE_TONES_H

#include "fsm_state.h"

#define TONES_COLUMNS 6 /* one, cosine and sine of each, y */

typedef struct tones {
    uint8_t sinusoids, known;          /* known: frequencies to fit amplitudes at */
    uint8_t changed;                   /* the signal is there at other frequencies: restart the inner method */
    uint8_t fitted, marked, alarms;    /* alarms: the user wants restarts */
    int64_t last_ns, solve_ns, omega_ns;
    double dt_s, memory_s, unit;       /* unit: SI of one count, for update_counts */
    double omega_rad_s[2], half_rad_s[2], phase[2];
    double y, origin;                  /* newest value; one near the signal, for digits */
    int32_t count;
    double s[TONES_COLUMNS * TONES_COLUMNS], weight, weight2, held_s;
    double fit[TONES_COLUMNS], error, noise, lag, judged; /* prediction errors since there is a fit: of as many samples */
    double usual[2], quiet;            /* amplitude when it was last valid, since the last restart, 0: not yet; mean square of the errors then */
    double mark[2], mark_half_rad_s[2], drift_rad_s[2]; /* fitted phase at mark_ns; what it turns by since, beyond its noise */
    double together;                   /* how much less a residual that hangs together tells, in variance */
    int64_t mark_ns, lost_ns;          /* lost: since when the signal is there and not explained; 0: it is */
    double share[3];                   /* of the memory: samples, y, y^2, whatever the frequencies */
    driveid_status status;
    driveid_estimate answer;
} tones;

/* 0 and a reason where the regression is none of driveid_frequency_regression(). */
int tones_configure(tones *self, driveid_svf_common *common, char *reason, size_t reason_size);
/* After the inner method took y (status: its answer); the status of the answer now. */
driveid_status tones_follow(tones *self, const driveid_svf_common *common, driveid_status status, int64_t t_ns, double y);
driveid_status tones_follow_count(tones *self, const driveid_svf_common *common, driveid_status status, int64_t t_ns, int32_t count);
driveid_status tones_answer_of(const tones *self, driveid_estimate *out);
void tones_restart(tones *self);

#endif
