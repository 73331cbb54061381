/* SPDX-License-Identifier: Apache-2.0 */
/* Residual monitor: does the model still explain the drive?
 *
 * Purpose: the one alarm of the project. The estimators restart on it, the model watchdog reports it.
 * Model: the residual e of an equation, its driving part y (rms of the largest term), and what the parameters' own uncertainty can
 *   explain, phi' cov phi. Mean squares over blocks of DRIVEID_MONITOR_BLOCK_S are compared with
 *     limit = threshold^2 * (noise + ratio * y^2 + DRIVEID_MONITOR_TOLERANCE^2 y^2) + 9 phi' cov phi
 *   where noise (mean square of e while the drive is quiet) and ratio (what e^2 has above that, of y^2, while it works) are slow means over
 *   blocks that were no alarm.
 * Method: after the prediction-error test of long-running frequency shifting [LONG-RUN]: energy of the prediction error in a short
 *   window against its usual level; two blocks in a row must be over the limit.
 * Parameters: plain struct of the caller; a copy is a snapshot.
 * Cost: about 10 operations a row, no stack to speak of. No allocation.
 * Accuracy: tests/unit/monitor_test.cpp (alarm rates), tests/property/day_test.cpp (every change of a working day, no false alarm). */
#ifndef DRIVEID_MONITOR_H
#define DRIVEID_MONITOR_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define DRIVEID_MONITOR_BLOCK_S 0.05
#define DRIVEID_MONITOR_TOLERANCE 0.003 /* times the threshold: what the model may miss of the drive, rms */

typedef struct driveid_monitor {
    double threshold;               /* default 4; < 0: never an alarm */
    double noise, ratio;            /* usual mean square of e; usual e^2 / y^2 */
    double level;                   /* usual y^2, tells work from rest */
    double e2, y2, p2, open_s;      /* open block */
    uint32_t rows;                  /* in the open block */
    uint32_t blocks;                /* learnt from, saturates */
    uint32_t over;                  /* blocks in a row over the limit */
    double last_e2, last_limit;     /* of the last closed block: how far the alarm is */
} driveid_monitor;

/* threshold: 0 takes the default. */
void driveid_monitor_init(driveid_monitor *self, double threshold);

/* One row: residual, square of the driving part, phi' cov phi, time since the last row. Returns 1 at an alarm, else 0.
 * Learns only from blocks below the limit; needs 1 s of rows before the first alarm. */
int driveid_monitor_feed(driveid_monitor *self, double residual, double drive_squared, double parameter_squared, double dt_s);

/* Forget the open block (after a gap or a restart); what is usual is kept. */
void driveid_monitor_skip(driveid_monitor *self);

#ifdef __cplusplus
}
#endif
#endif
