/* SPDX-License-Identifier: Apache-2.0 */
/* Methods that weigh the last N samples with a fixed function that vanishes at both ends of the window, so that the derivatives move from the
 * signals to the weights and neither initial conditions nor filters' states are left: window (Oueslati: integrals) and discrete (Fliess: sums).
 *
 * Rows of windows of several lengths are taken every eighth of a window and accumulated, so that no single window can be singular.
 * Cost: 8 multiply-adds a term, stage and sample on average, N terms in the sample that takes the row. In floating point the recursion that would
 * make each row O(1) is only marginally stable (its rounding grows with a power of time), so it is not used. */
#ifndef DRIVEID_ESTIMATE_KERNEL_H
#define DRIVEID_ESTIMATE_KERNEL_H

#include "learn.h"

#define KERNEL_SAMPLES 2001  /* longest window, with both ends */
#define KERNEL_RING 4096     /* values: samples x channels */
#define KERNEL_POOL 8192     /* weights */
#define KERNEL_SHAPES 12
#define KERNEL_STAGE_RATIO 3
#define KERNEL_ROWS 8        /* a window */

typedef struct kernel_shape { /* all that a term's weights depend on */
    uint8_t derivative, hold, order; /* order: of the term's equation */
} kernel_shape;

/* Weights of n + 1 samples at u[0 .. n] (0 to 1) of a window of T_s. */
typedef void (*kernel_weights)(const kernel_shape *shape, const double *u, int n, double T_s, double *out);
void kernel_window_weights(const kernel_shape *shape, const double *u, int n, double T_s, double *out);
void kernel_discrete_weights(const kernel_shape *shape, const double *u, int n, double T_s, double *out);

/* Lists the shapes of the regression's terms; 0: more than KERNEL_SHAPES. */
int kernel_shapes(const driveid_svf_common *common, kernel_shape *shape, uint8_t *of_term);
/* Window lengths in samples, multiples of 4; the number of stages that fit. 0 with a reason: none. */
int kernel_lengths(const driveid_svf_common *common, unsigned shapes, uint16_t *length, char *reason, size_t reason_size);

/* q = (2/T) tanh(sT/2) is not s: relative error of a second derivative at a quarter of the bandwidth, which no statistics see. */
static inline double kernel_bilinear_error(const driveid_estimator_options *o) {
    const double x = o->bandwidth_rad_s * o->dt_s / 4;
    return x * x / 6;
}

#include "base/real_f64.h"
#include "kernel_decl.inc"
#include "base/real_f32.h"
#include "kernel_decl.inc"

#endif
