/* SPDX-License-Identifier: Apache-2.0 */
/* estimate.h and regression.h: an equation of your own, its estimator, a snapshot.
 *   R i + L di/dt = v  with  R = 2 ohm, L = 10 mH, the voltage steps between 1 V and 3 V */
#include <driveid/estimate.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

typedef union { double align; unsigned char bytes[DRIVEID_ESTIMATOR_BYTES]; } storage;
static storage memory, snapshot;

int main(void) {
    driveid_estimator *e = (driveid_estimator *)memory.bytes;
    const driveid_regression circuit = {
        .equations = 1, .channels = 2, .params = 2, .terms = 3,
        .hold = {DRIVEID_HOLD_FIRST, DRIVEID_HOLD_ZERO}, /* current: smooth; voltage: held */
        .term = {{0, 0, 0, 0, 1.0}, {0, 0, 1, 1, 1.0}, {0, 1, 0, DRIVEID_TERM_KNOWN, -1.0}}};
    const driveid_estimator_options options = {.dt_s = 5e-4};
    char reason[160];
    if (driveid_estimator_configure(e, sizeof memory, "fsm", DRIVEID_F32, &circuit, &options, reason, sizeof reason)) {
        printf("refused: %s\n", reason);
        return 1;
    }
    double i_A = 0;
    for (int k = 0; k < 4000; k++) {
        const double v_V = (k / 37) % 2 ? 3 : 1, channel[2] = {i_A, v_V};
        const driveid_status s = driveid_estimator_update(e, INT64_C(500000) * k, channel);
        if (s < 0) printf("sample %d: %s\n", k, driveid_status_text(s));
        i_A = v_V / 2 + (i_A - v_V / 2) * exp(-2 / 10e-3 * 5e-4);
    }
    memcpy(&snapshot, &memory, sizeof memory); /* no self-pointers: a copy is a snapshot */
    driveid_estimate a;
    const driveid_status s = driveid_estimator_estimate((driveid_estimator *)snapshot.bytes, &a);
    printf("%s: R = %.4f [%.4f, %.4f] ohm, L = %.5f [%.5f, %.5f] H\n", driveid_status_text(s), a.theta[0], a.lo[0], a.hi[0], a.theta[1], a.lo[1], a.hi[1]);
    return s != DRIVEID_OK || fabs(a.theta[0] - 2) > 0.01 || fabs(a.theta[1] - 0.01) > 1e-4;
}
