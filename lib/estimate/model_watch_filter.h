/* SPDX-License-Identifier: Apache-2.0 */
/* The low-pass of the filter bank (base/bank.h) over many columns, read once in a while.
 *
 * Method: a cascade of N equal sections,  v_j' = lambda (v_{j-1} - v_j),  v_0 = column,  columns joined by straight lines. With P(t) the transition
 *   P(T) integral P(-t) b v_0(t) dt = integral P(T - t) b v_0(t) dt
 * so a sample adds its column times N weights, the same for all columns: the integrals of lambda e^(lambda t) (-lambda t)^k / k! under the hat of that
 * sample. P(T) is applied where the output is read, and to the states once in a while. Stamps need not be uniform.
 * Cost a sample: N multiply-adds a column, 3 exp(); a reading: N + 1 a column. */
#ifndef DRIVEID_ESTIMATE_MODEL_WATCH_FILTER_H
#define DRIVEID_ESTIMATE_MODEL_WATCH_FILTER_H

#include <stdint.h>

#define WATCH_COLUMNS 176
#define WATCH_SECTIONS 4 /* of a balance of second order in the angle */

typedef struct watch_filter {
    uint8_t columns, sections;
    double pole_rad_s;
    double open;                                /* lambda t since the states were moved on */
    double late[WATCH_SECTIONS];                /* weight that the last column has so far */
    double last[WATCH_COLUMNS];                 /* the column of the last sample */
    double state[WATCH_SECTIONS][WATCH_COLUMNS];
} watch_filter;

void watch_filter_init(watch_filter *filter, unsigned columns, unsigned sections, double pole_rad_s);
/* Everything was zero before. The caller then writes the first sample's columns to filter->last. */
void watch_filter_start(watch_filter *filter);
/* dt_ns have passed since the last sample. The caller then writes the new columns to filter->last. */
void watch_filter_step(watch_filter *filter, int64_t dt_ns);
/* output[columns] at the last sample. */
void watch_filter_read(const watch_filter *filter, double *output);

#endif
