/* SPDX-License-Identifier: Apache-2.0 */
/* One program for host and target: each method and type on the same drive, its answer to the last bit, a gap, a restart, refusals.
 *   run METHOD TYPE SAMPLES   (target: as compiled in by RUN_METHOD, RUN_TYPE, RUN_SAMPLES; none: all of them) */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>


#include "axis.h"

static int is_tone(const char *method) { return strcmp(method, "frequency") == 0; }

/* 0.5 + 0.7 sin(2 pi 7 Hz t) by turning a pointer: no libm. */
static void tone_sample(double *channel) {
    static double cosine = 0.7, sine = 0;
    const double c = 0.9990329346781247, s = 0.0439681183178649, turned = c * cosine - s * sine;
    sine = c * sine + s * cosine;
    cosine = turned;
    channel[0] = 0.5 + sine;
}

static int configure(const char *method, driveid_real type) {
    driveid_regression r;
    driveid_estimator_options o;
    char reason[200] = "";
    memset(&o, 0, sizeof o);
    if (is_tone(method)) driveid_frequency_regression(1, 100, &r); /* rad/s */
    else r = axis_equation();
    o.dt_s = 1e-3, o.range[0] = is_tone(method) ? 4 : AXIS_RANGE_RAD, o.range[1] = AXIS_RANGE_NM;
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
    axis_start(8192.0);
    if (!configure(method, type)) return 0;
    for (int n = 0; n < samples; n++, t_ns += 1000000) {
        if (is_tone(method)) tone_sample(channel);
        else axis_sample(channel);
        driveid_estimator_update(ESTIMATOR, t_ns, channel);
    }
    if (samples < 2000) return 1; /* counted, not judged */
    if (is_tone(method)) return tell(method, type, "end"), 1; /* judged by who reads it */
    good &= tell(method, type, "end");
    t_ns += 300000000;
    axis_sample(channel);
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
