/* SPDX-License-Identifier: Apache-2.0 */
/* The estimator's unit checks in plain C: the host's test program (tests/unit/portable_test.cpp) and the processor under qemu (test_target.py) run this file.
 * Storage of one estimator is all they need, so that they fit a board of 16 KiB. */
#include "checks.h"

#include <string.h>

#include "axis.h"

#define MS INT64_C(1000000)
#define EXPECT(condition)                 \
    do {                                  \
        if (!(condition)) return __LINE__; \
    } while (0)

static int64_t t_ns;
static uint32_t noise_state;
static double noise_rad;

static driveid_estimator_options options(void) {
    static const driveid_estimator_options none;
    driveid_estimator_options o = none;
    o.dt_s = 1e-3, o.answer_s = 0.1; /* a tenth of a second: solves are software on a processor without double */
    o.range[0] = AXIS_RANGE_RAD, o.range[1] = AXIS_RANGE_NM;
    return o;
}

static driveid_status configure_with(const char *method, driveid_real type, const driveid_estimator_options *o) {
    const driveid_regression r = axis_equation();
    memset(&storage, 0, sizeof storage);
    return driveid_estimator_configure(ESTIMATOR, sizeof storage, method, type, &r, o, NULL, 0);
}

static driveid_status configure(const char *method, driveid_real type) {
    const driveid_estimator_options o = options();
    axis_start(8192.0);
    t_ns = 1, noise_state = 1, noise_rad = 0;
    return configure_with(method, type, &o);
}

static double noise(void) { /* four uniform numbers: nearly normal */
    double sum = 0;
    for (int i = 0; i < 4; i++) {
        noise_state = noise_state * UINT32_C(1664525) + UINT32_C(1013904223);
        sum += (double)(noise_state >> 8) / 16777216.0 - 0.5;
    }
    return noise_rad * 1.7320508 * sum;
}

static driveid_status feed_at(driveid_estimator *estimator, int samples) {
    driveid_status status = DRIVEID_OK;
    for (int n = 0; n < samples; n++, t_ns += MS) {
        double channel[2];
        axis_sample(channel);
        channel[0] += noise();
        status = driveid_estimator_update(estimator, t_ns, channel);
        if (status < 0) return status;
    }
    return status;
}

static driveid_status feed(int samples) { return feed_at(ESTIMATOR, samples); }

static driveid_estimate answer; /* too large for a small stack */

static driveid_status ask(void) { return driveid_estimator_estimate(ESTIMATOR, &answer); }

static int within(double value, double truth, double part) { return value > truth * (1 - part) && value < truth * (1 + part); }

static int near_truth(void) { return within(answer.theta[0] * drive.inverse_J, 1, 0.005) && within(answer.theta[1] * drive.inverse_J, 2, 0.05); }

static int values(const char *method, driveid_real type) {
    EXPECT(configure(method, type) == DRIVEID_OK);
    EXPECT(ask() == DRIVEID_NOT_YET);
    EXPECT(feed(1) == DRIVEID_NOT_YET);
    EXPECT(feed(2999) == DRIVEID_OK);
    EXPECT(ask() == DRIVEID_OK);
    EXPECT(near_truth());
    EXPECT(answer.params == 2 && answer.valid_mask == 3 && answer.weak_mask == 0 && answer.restarts == 0 && answer.samples > 0);
    EXPECT(answer.first_ns == 1 && answer.t_ns < t_ns && answer.t_ns >= t_ns - 101 * MS);
    EXPECT(answer.first_trusted_ns > 0 && answer.first_trusted_ns < 1500 * MS);
    return 0;
}

/* A record's end is one draw: three half-widths hold 99.9 % of them. */
static int intervals(const char *method, driveid_real type) {
    EXPECT(configure(method, type) == DRIVEID_OK);
    noise_rad = 1e-3;
    EXPECT(feed(4000) == DRIVEID_OK);
    EXPECT(ask() == DRIVEID_OK);
    for (int i = 0; i < 2; i++) {
        const double half = (answer.hi[i] - answer.lo[i]) / 2, error = answer.theta[i] - (1 + i) / drive.inverse_J;
        EXPECT(half > 0 && half < 0.05 * answer.theta[i]);
        EXPECT(error < 3 * half && error > -3 * half);
        EXPECT(answer.cov[3 * i] > 0);
    }
    return 0;
}

static int refusals(const char *method, driveid_real type) {
    char reason[120] = "";
    driveid_estimator_options o = options();
    driveid_regression r = axis_equation();
    o.dt_s = 0;
    EXPECT(driveid_estimator_configure(ESTIMATOR, sizeof storage, method, type, &r, &o, reason, sizeof reason) == DRIVEID_ERR_CONFIG && strstr(reason, "dt_s"));
    o = options(), o.bandwidth_rad_s = 5000;
    EXPECT(driveid_estimator_configure(ESTIMATOR, sizeof storage, method, type, &r, &o, reason, sizeof reason) == DRIVEID_ERR_CONFIG && strstr(reason, "bandwidth_rad_s"));
    o = options(), r.term[0].channel = 3;
    EXPECT(driveid_estimator_configure(ESTIMATOR, sizeof storage, method, type, &r, &o, reason, sizeof reason) == DRIVEID_ERR_CONFIG && strstr(reason, "channel"));
    r = axis_equation(), r.term[1].param = 0;
    EXPECT(driveid_estimator_configure(ESTIMATOR, sizeof storage, method, type, &r, &o, reason, sizeof reason) == DRIVEID_ERR_CONFIG && strstr(reason, "parameter has no term"));
    r = axis_equation();
    EXPECT(driveid_estimator_configure(ESTIMATOR, sizeof storage, "magic", type, &r, &o, reason, sizeof reason) == DRIVEID_ERR_CONFIG && strstr(reason, "choose"));
    EXPECT(driveid_estimator_configure(ESTIMATOR, 100, method, type, &r, &o, reason, sizeof reason) == DRIVEID_ERR_CAPACITY);
    EXPECT(driveid_estimator_configure(NULL, 0, method, type, &r, &o, NULL, 0) == DRIVEID_ERR_ARGUMENT);
    o.range[1] = 0;
    const driveid_status unranged = driveid_estimator_configure(ESTIMATOR, sizeof storage, method, type, &r, &o, reason, sizeof reason);
    EXPECT(type == DRIVEID_Q31 ? unranged == DRIVEID_ERR_CONFIG && strstr(reason, "range of channel 1") : unranged == DRIVEID_OK);
    return 0;
}

static int same_as(const driveid_estimate *e) {
    return memcmp(e->theta, answer.theta, sizeof e->theta) == 0 && memcmp(e->lo, answer.lo, sizeof e->lo) == 0 && memcmp(e->hi, answer.hi, sizeof e->hi) == 0 && e->t_ns == answer.t_ns;
}

static driveid_estimate kept;

static int bad_samples(const char *method, driveid_real type) {
    EXPECT(configure(method, type) == DRIVEID_OK);
    EXPECT(feed(2400) == DRIVEID_OK && ask() == DRIVEID_OK);
    kept = answer;
    EXPECT(configure(method, type) == DRIVEID_OK);
    for (int n = 0; n < 24; n++) {
        const double wild[2] = {9, 0.01};
        double none[2] = {0, 0};
        EXPECT(feed(100) >= 0);
        EXPECT(driveid_estimator_update(ESTIMATOR, t_ns - MS, wild) == DRIVEID_DUPLICATE);
        EXPECT(driveid_estimator_update(ESTIMATOR, t_ns - 5 * MS, wild) == DRIVEID_ERR_TIME);
        none[0] = 0 * (1e308 * 1e308 * wild[0]); /* not a number */
        EXPECT(driveid_estimator_update(ESTIMATOR, t_ns, none) == DRIVEID_ERR_VALUE);
    }
    EXPECT(ask() == DRIVEID_OK && same_as(&kept));
    return 0;
}

static int gap_and_on(const char *method, driveid_real type, int told) {
    EXPECT(configure(method, type) == DRIVEID_OK);
    EXPECT(feed(2500) == DRIVEID_OK && ask() == DRIVEID_OK);
    kept = answer;
    drive.theta += 5, drive.omega = -3; /* the drive moved on unseen */
    if (told) driveid_estimator_gap(ESTIMATOR); /* two samples are missing, which no stamp shows where jitter is allowed */
    else t_ns += 300 * MS;
    EXPECT(feed(1) == DRIVEID_GAP);
    EXPECT(ask() == DRIVEID_OK && same_as(&kept)); /* what was learnt stays */
    EXPECT(feed(2500) == DRIVEID_OK && ask() == DRIVEID_OK);
    EXPECT(near_truth() && answer.restarts == 0);
    return 0;
}

static int gaps(const char *method, driveid_real type) { return gap_and_on(method, type, 0); }
static int told_gaps(const char *method, driveid_real type) { return gap_and_on(method, type, 1); }

static int rests(const char *method, driveid_real type) {
    driveid_status status = DRIVEID_OK;
    EXPECT(configure(method, type) == DRIVEID_OK);
    EXPECT(feed(2500) == DRIVEID_OK);
    for (int n = 0; n < 6000; n++, t_ns += MS) { /* brought to a stand, ever more slowly */
        const double channel[2] = {drive.theta, -0.001 * drive.omega};
        status = driveid_estimator_update(ESTIMATOR, t_ns, channel);
        axis_move(channel[1]);
    }
    EXPECT(status == DRIVEID_FROZEN);
    EXPECT(ask() == DRIVEID_FROZEN && near_truth() && answer.t_ns < t_ns - 1000 * MS);
    EXPECT(feed(2500) == DRIVEID_OK && ask() == DRIVEID_OK && near_truth() && answer.restarts == 0);
    return 0;
}

static int restarts(const char *method, driveid_real type) {
    EXPECT(configure(method, type) == DRIVEID_OK);
    EXPECT(feed(2500) == DRIVEID_OK && ask() == DRIVEID_OK);
    driveid_estimator_restart(ESTIMATOR);
    EXPECT(ask() == DRIVEID_NOT_YET);
    drive.inverse_J = 4096;
    EXPECT(feed(2500) == DRIVEID_OK && ask() == DRIVEID_OK && near_truth());
    return 0;
}

static int alarms(const char *method, driveid_real type) {
    EXPECT(configure(method, type) == DRIVEID_OK);
    noise_rad = 1e-4;
    EXPECT(feed(5000) == DRIVEID_OK && ask() == DRIVEID_OK && answer.restarts == 0);
    drive.inverse_J = 5000;
    EXPECT(feed(5000) == DRIVEID_OK && ask() == DRIVEID_OK);
    EXPECT(answer.restarts == 1 && near_truth());
    return 0;
}

/* No self-pointers: bytes that lie elsewhere go on as before. The copy is to other storage where there is room for it, else a few bytes further on. */
static int snapshots(const char *method, driveid_real type) {
    static union { double align; unsigned char bytes[CHECKS_SHIFT]; } before;
    const size_t size = driveid_estimator_size(method, type);
    unsigned char *at = storage.bytes + CHECKS_SHIFT;
    EXPECT(configure(method, type) == DRIVEID_OK);
    EXPECT(feed(2400) == DRIVEID_OK && ask() == DRIVEID_OK);
    kept = answer;
    EXPECT(size + CHECKS_SHIFT <= sizeof storage);
    EXPECT(configure(method, type) == DRIVEID_OK);
    EXPECT(feed(1200) >= 0);
    memmove(at, storage.bytes, size);
    memset(storage.bytes, 0xff, CHECKS_SHIFT);
    memcpy(before.bytes, storage.bytes, CHECKS_SHIFT);
    EXPECT(feed_at((driveid_estimator *)(void *)at, 1200) == DRIVEID_OK);
    EXPECT(memcmp(before.bytes, storage.bytes, CHECKS_SHIFT) == 0); /* nothing reached back */
    EXPECT(driveid_estimator_estimate((driveid_estimator *)(void *)at, &answer) == DRIVEID_OK && same_as(&kept));
    return 0;
}

static int saturation(const char *method, driveid_real type) {
    driveid_estimator_options o = options();
    EXPECT(configure(method, type) == DRIVEID_OK);
    drive.theta = 1e6; /* any number of turns */
    EXPECT(feed(2500) == DRIVEID_OK && ask() == DRIVEID_OK);
    EXPECT(driveid_estimator_saturations(ESTIMATOR) == 0);
    EXPECT(type == DRIVEID_F32 || near_truth());
    o.range[1] = 0.005; /* a fifth of the torque */
    EXPECT(configure_with(method, type, &o) == DRIVEID_OK);
    EXPECT(feed(1000) >= 0);
    EXPECT(type == DRIVEID_Q31 ? driveid_estimator_saturations(ESTIMATOR) > 100 : driveid_estimator_saturations(ESTIMATOR) == 0);
    return 0;
}

static int counts(const char *method, driveid_real type) {
    EXPECT(configure(method, type) == DRIVEID_OK);
    if (type != DRIVEID_Q31) {
        const int32_t none[2] = {0, 0};
        EXPECT(driveid_estimator_update_counts(ESTIMATOR, 1, none) == DRIVEID_ERR_ARGUMENT);
        return 0;
    }
    for (int pass = 0; pass < 2; pass++) {
        EXPECT(configure(method, type) == DRIVEID_OK);
        for (int n = 0; n < 2000; n++, t_ns += MS) {
            double channel[2];
            axis_sample(channel);
            const int32_t count[2] = {(int32_t)(channel[0] / AXIS_RANGE_RAD * 1073741824.0), (int32_t)(channel[1] / AXIS_RANGE_NM * 1073741824.0)};
            const double exact[2] = {count[0] / 1073741824.0 * AXIS_RANGE_RAD, count[1] / 1073741824.0 * AXIS_RANGE_NM};
            EXPECT((pass ? driveid_estimator_update_counts(ESTIMATOR, t_ns, count) : driveid_estimator_update(ESTIMATOR, t_ns, exact)) >= 0);
        }
        EXPECT(ask() == DRIVEID_OK && near_truth());
        if (pass == 0) kept = answer;
    }
    EXPECT(same_as(&kept));
    return 0;
}

static const struct {
    const char *name;
    int (*run)(const char *method, driveid_real type);
} table[] = {{"values", values}, {"intervals", intervals}, {"refusals", refusals}, {"bad_samples", bad_samples}, {"gaps", gaps}, {"told_gaps", told_gaps}, {"rests", rests},
             {"restarts", restarts}, {"alarms", alarms}, {"snapshots", snapshots}, {"saturation", saturation}, {"counts", counts}};

const char *checks_name(unsigned index) { return index < sizeof table / sizeof table[0] ? table[index].name : NULL; }

int checks_run(unsigned index, const char *method, driveid_real type) { return table[index].run(method, type); }
