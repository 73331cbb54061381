/* SPDX-License-Identifier: Apache-2.0 */
/* One program for host and target: each method and type on the same drive, its answer to the last bit, a gap, a restart, refusals.
 * Samples come from + - * in double alone, so every IEEE machine makes the same ones.
 *   run METHOD TYPE SAMPLES   (target: as compiled in by RUN_METHOD, RUN_TYPE, RUN_SAMPLES; none: all of them) */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "driveid.h"

#ifdef RUN_BYTES
#define BYTES RUN_BYTES
#else
#define BYTES DRIVEID_ESTIMATOR_BYTES
#endif

static union { double align; unsigned char bytes[BYTES]; } storage;
#define ESTIMATOR ((driveid_estimator *)(void *)&storage)

static struct { double theta, omega; int64_t k; } drive;

static double triangle(int64_t k, int64_t period) {
    const int64_t at = k % period, half = period / 2;
    return at < half ? 4.0 * (double)at / (double)period - 1 : 3 - 4.0 * (double)at / (double)period;
}

/* J 1/8192, B 1/4096; torque held over the millisecond, exact but for the fourth order of the step. */
static void sample(double *channel) {
    const double tau = 0.015 * triangle(drive.k, 620) + 0.01 * triangle(drive.k, 270), h = 1e-3, rate = 2.0, a = tau * 8192.0 - rate * drive.omega;
    channel[0] = drive.theta;
    channel[1] = tau;
    drive.theta += h * (drive.omega + h / 2 * a * (1 - rate * h / 3 * (1 - rate * h / 4)));
    drive.omega += h * a * (1 - rate * h / 2 * (1 - rate * h / 3));
    drive.k++;
}

static int configure(const char *method, driveid_real type) {
    driveid_regression r;
    driveid_estimator_options o;
    char reason[200] = "";
    memset(&r, 0, sizeof r);
    memset(&o, 0, sizeof o);
    r.equations = 1, r.channels = 2, r.params = 2, r.terms = 3, r.may_be_zero = 2;
    r.hold[1] = DRIVEID_HOLD_ZERO;
    r.term[0] = (driveid_term){0, 0, 2, 0, 1};
    r.term[1] = (driveid_term){0, 0, 1, 1, 1};
    r.term[2] = (driveid_term){0, 1, 0, DRIVEID_TERM_KNOWN, -1};
    o.dt_s = 1e-3, o.range[0] = 64, o.range[1] = 0.0625;
    const driveid_status status = driveid_estimator_configure(ESTIMATOR, sizeof storage, method, type, &r, &o, reason, sizeof reason);
    if (status) printf("%s %d: refused: %s\n", method, type, reason);
    return status == DRIVEID_OK;
}

static void print_bits(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    printf(" %08lx%08lx", (unsigned long)(bits >> 32), (unsigned long)(bits & 0xffffffffu));
}

static int tell(const char *method, driveid_real type, const char *when) {
    static const char *const names[] = {"f64", "f32", "q31"};
    driveid_estimate e;
    memset(&e, 0, sizeof e);
    const driveid_status status = driveid_estimator_estimate(ESTIMATOR, &e);
    printf("%s %s %s status %d J", method, names[type], when, status);
    print_bits(e.theta[0]);
    print_bits(e.lo[0]);
    print_bits(e.theta[1]);
    const double error = e.theta[0] * 8192 - 1;
    printf(" J within 1 %%: %s\n", error < 0.01 && error > -0.01 ? "yes" : "no");
    return status == DRIVEID_OK && error < 0.01 && error > -0.01;
}

static int run(const char *method, driveid_real type, int samples) {
    double channel[2];
    int64_t t_ns = 1;
    int good = 1;
    memset(&drive, 0, sizeof drive);
    if (!configure(method, type)) return 0;
    for (int n = 0; n < samples; n++, t_ns += 1000000) {
        sample(channel);
        driveid_estimator_update(ESTIMATOR, t_ns, channel);
    }
    if (samples < 2000) return 1; /* counted, not judged */
    good &= tell(method, type, "end");
    t_ns += 300000000;
    sample(channel);
    good &= driveid_estimator_update(ESTIMATOR, t_ns, channel) == DRIVEID_GAP;
    driveid_estimator_restart(ESTIMATOR);
    driveid_estimate e;
    good &= driveid_estimator_estimate(ESTIMATOR, &e) == DRIVEID_NOT_YET;
    return good;
}

int main(int argc, char **argv) {
#ifdef RUN_METHOD
    (void)argc, (void)argv;
    return run(RUN_METHOD, RUN_TYPE, RUN_SAMPLES) ? 0 : 1;
#else
    static const char *const all[] = {"fsm", "rls", "window", "discrete"};
    int bad = 0;
    const driveid_real last = argc > 1 ? (driveid_real)atoi(argv[1]) : DRIVEID_Q31;
    for (int i = 0; i < 4; i++)
        for (int type = DRIVEID_F32; type <= (int)last; type++) bad += !run(all[i], (driveid_real)type, 2500);
    printf("%d failed\n", bad);
    return bad;
#endif
}
