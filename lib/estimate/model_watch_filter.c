/* SPDX-License-Identifier: Apache-2.0 */
#include "model_watch_filter.h"

#include <math.h>
#include <string.h>

#define OPEN 3.0 /* times 1/pole: weights grow as e^3 */
#define PART 0.5 /* of 1/pole: three points of Gauss leave 1e-7 of it */

void watch_filter_init(watch_filter *f, unsigned columns, unsigned sections, double pole_rad_s) {
    memset(f, 0, sizeof *f);
    f->columns = (uint8_t)columns;
    f->sections = (uint8_t)sections;
    f->pole_rad_s = pole_rad_s;
}

void watch_filter_start(watch_filter *f) {
    memset(f->late, 0, sizeof f->late);
    memset(f->state, 0, sizeof f->state);
    f->open = 0;
}

/* Integrals of e^x (-x)^k / k! over [from, from + length], times what falls from 1 to 0 (early) and what rises from 0 to 1 (late). */
static void weigh(double from, double length, unsigned sections, double *early, double *late) {
    static const double place[3] = {0.11270166537925831, 0.5, 0.88729833462074169}, share[3] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
    const unsigned parts = length > PART ? (unsigned)ceil(length / PART) : 1;
    for (unsigned i = 0; i < 3 * parts; i++) {
        const double s = (i / 3 + place[i % 3]) / parts, x = from + s * length;
        double kernel = exp(x) * length * share[i % 3] / parts;
        for (unsigned k = 0; k < sections; k++) {
            early[k] += kernel * (1 - s);
            late[k] += kernel * s;
            kernel *= -x / (k + 1);
        }
    }
}

/* P(open). */
static void transition(const watch_filter *f, double *p) {
    p[0] = exp(-f->open);
    for (unsigned k = 1; k < f->sections; k++) p[k] = p[k - 1] * f->open / k;
}

static void add_to_all(watch_filter *f, const double *weight) {
    for (unsigned c = 0; c < f->columns; c++) {
        const double x = f->last[c];
        for (unsigned k = 0; k < WATCH_SECTIONS; k++) f->state[k][c] += weight[k] * x;
    }
}

/* The states as they are now, so that the weights stay small. */
static void move_on(watch_filter *f) {
    double p[WATCH_SECTIONS];
    transition(f, p);
    add_to_all(f, f->late);
    for (unsigned k = f->sections; k-- > 0;)
        for (unsigned c = 0; c < f->columns; c++) {
            double sum = 0;
            for (unsigned j = 0; j <= k; j++) sum += p[k - j] * f->state[j][c];
            f->state[k][c] = sum; /* those below are not yet moved on */
        }
    memset(f->late, 0, sizeof f->late);
    f->open = 0;
}

void watch_filter_step(watch_filter *f, int64_t dt_ns) {
    const double length = f->pole_rad_s * 1e-9 * (double)dt_ns;
    double early[WATCH_SECTIONS], late[WATCH_SECTIONS] = {0};
    if (f->open > OPEN) move_on(f);
    memcpy(early, f->late, sizeof early);
    weigh(f->open, length, f->sections, early, late);
    add_to_all(f, early);
    memcpy(f->late, late, sizeof late);
    f->open += length;
}

void watch_filter_read(const watch_filter *f, double *output) {
    double p[WATCH_SECTIONS], weight[WATCH_SECTIONS] = {0}, last = 0;
    transition(f, p);
    for (unsigned k = 0; k < f->sections; k++) {
        weight[k] = p[f->sections - 1 - k];
        last += weight[k] * f->late[k];
    }
    for (unsigned c = 0; c < f->columns; c++) {
        double sum = last * f->last[c];
        for (unsigned k = 0; k < WATCH_SECTIONS; k++) sum += weight[k] * f->state[k][c];
        output[c] = sum;
    }
}
