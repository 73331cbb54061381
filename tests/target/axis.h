/* SPDX-License-Identifier: Apache-2.0 */
/* A rigid axis for host and target alike, and the storage of one estimator. Samples come from + - * in double alone, so every IEEE machine makes the same ones. */
#ifndef DRIVEID_TARGET_AXIS_H
#define DRIVEID_TARGET_AXIS_H

#ifdef RUN_INSTALLED /* the library's own headers, else the amalgamated one */
#include <driveid/estimate.h>
#else
#include "driveid.h"
#endif

#ifndef RUN_BYTES
#define RUN_BYTES DRIVEID_ESTIMATOR_BYTES
#endif

#define AXIS_RANGE_RAD 64.0
#define AXIS_RANGE_NM 0.0625

static union { double align; unsigned char bytes[RUN_BYTES]; } storage;
#define ESTIMATOR ((driveid_estimator *)(void *)&storage)

/* J 1/inverse, B 2 J */
static struct { double theta, omega, inverse_J; int64_t k; } drive;

static void axis_start(double inverse_J) { drive.theta = drive.omega = 0, drive.inverse_J = inverse_J, drive.k = 0; }

static double triangle(int64_t k, int64_t period) {
    const int64_t at = k % period, half = period / 2;
    return at < half ? 4.0 * (double)at / (double)period - 1 : 3 - 4.0 * (double)at / (double)period;
}

/* Torque held over the millisecond, exact but for the fourth order of the step. */
static void axis_move(double tau) {
    const double h = 1e-3, rate = 2.0, a = tau * drive.inverse_J - rate * drive.omega;
    drive.theta += h * (drive.omega + h / 2 * a * (1 - rate * h / 3 * (1 - rate * h / 4)));
    drive.omega += h * a * (1 - rate * h / 2 * (1 - rate * h / 3));
    drive.k++;
}

static void axis_sample(double *channel) {
    channel[0] = drive.theta;
    channel[1] = 0.015 * triangle(drive.k, 620) + 0.01 * triangle(drive.k, 270);
    axis_move(channel[1]);
}

static driveid_regression axis_equation(void) {
    static const driveid_regression none;
    driveid_regression r = none;
    r.equations = 1, r.channels = 2, r.params = 2, r.terms = 3, r.may_be_zero = 2;
    r.hold[1] = DRIVEID_HOLD_ZERO;
    r.term[0] = (driveid_term){0, 0, 2, 0, 1};
    r.term[1] = (driveid_term){0, 0, 1, 1, 1};
    r.term[2] = (driveid_term){0, 1, 0, DRIVEID_TERM_KNOWN, -1};
    return r;
}

#endif
