/* SPDX-License-Identifier: Apache-2.0 */
/* How much older than their stamps the readings of the driving signal are beside those of the motion: with i(t) = i_m(t + s),
 *   y = phi theta - s K i_m' + dry friction and load that the model may lack,
 * all behind the same filters, theta free. The interval is a jackknife over groups of motion: an error that differs from move to move widens it. */
#include <math.h>
#include <string.h>

#include "model_watch_state.h"

#define BLOCK_S 1.0        /* of motion with one group, then the next one's turn */
#define KEEP 0.8           /* of a group's sums when its turn comes again: about 50 s of motion are remembered */
#define LEAST_S 10.0       /* of motion, one turn of every group */
#define APART 0.01         /* of the slope's square that nothing else explains: less is no independent motion */
#define QUANTILE 2.262     /* 97.5 % of Student's t with 9 degrees */
#define JOINED 0.01        /* of the sample time: what the joining of readings by parabolas leaves, the same in every group */
#define WORST 0.25         /* of the sample time: a wider interval is that of a model which lacks something */
#define LARGEST 0.7        /* times 1/pole: beyond it a slope does not stand for a shift */

static int index_of(const driveid_watch *w, const char *name) {
    for (unsigned k = 0; k < w->candidates; k++)
        if (strcmp(driveid_effect_at(w->candidate[k].effect)->name, name) == 0) return w->candidate[k].first;
    return -1;
}

static int is_delay(const driveid_watch *w, int candidate) {
    return candidate >= 0 && strcmp(driveid_effect_at(w->candidate[candidate].effect)->name, "delay") == 0;
}

void watch_skew_init(driveid_watch *w) {
    static const char *const beside[] = {"coulomb", "constant_load", "delay"};
    watch_skew *s = &w->skew;
    memset(s, 0, sizeof *s);
    s->terms = w->params;
    for (unsigned k = 0; k < 3; k++) {
        int has = 0;
        for (uint32_t i = 0; i < w->online.model.effects; i++) has |= strcmp(w->online.model.effect[i].name, beside[k]) == 0;
        const int column = index_of(w, beside[k]);
        if (k == 2 && (has || column < 0)) s->terms = 0; /* the model shifts the channel itself, or nothing drives the equation */
        else if (!has && column >= 0) s->column[s->terms++ - w->params] = (uint8_t)column;
    }
}

void watch_skew_clear(driveid_watch *w) {
    memset(w->skew.sum, 0, sizeof w->skew.sum);
    w->skew.motion_s = w->skew.block_s = 0;
    w->report.skew_known = 0;
}

/* Slope's coefficient by Cholesky of the normal equations, the slope last but one and y last. */
static int solve(const watch_skew *s, double (*a)[WATCH_SKEW], double *coefficient) {
    const unsigned n = s->terms + 1u;
    for (unsigned i = 0; i < n; i++) {
        const double whole = a[i][i];
        for (unsigned j = 0; j <= i; j++) {
            double sum = a[i][j];
            for (unsigned k = 0; k < j; k++) sum -= a[i][k] * a[j][k];
            if (j < i) {
                a[i][j] = sum / a[j][j];
            } else if (i + 1 < n) {
                if (!(sum > (i + 2 == n ? APART : 1e-9) * whole)) return 0;
                a[i][i] = sqrt(sum);
            }
        }
    }
    *coefficient = a[n - 1][n - 2] / a[n - 2][n - 2];
    return 1;
}

/* All groups but one (without < 0: all). */
static int solve_without(const watch_skew *s, int without, double *coefficient) {
    double a[WATCH_SKEW][WATCH_SKEW] = {{0}};
    const unsigned n = s->terms + 1u;
    for (int g = 0; g < WATCH_GROUPS; g++)
        for (unsigned i = 0; g != without && i < n; i++)
            for (unsigned j = 0; j <= i; j++) a[i][j] += s->sum[g][i][j];
    return solve(s, a, coefficient);
}

static void answer(driveid_watch *w) {
    driveid_watch_report *r = &w->report;
    double all, each[WATCH_GROUPS], mean = 0, square = 0;
    r->skew_known = 0;
    if (r->mismatch && !is_delay(w, w->said)) return; /* a missing effect may look like one */
    if (w->skew.motion_s < LEAST_S || !solve_without(&w->skew, -1, &all)) return;
    for (int g = 0; g < WATCH_GROUPS; g++) {
        if (!solve_without(&w->skew, g, &each[g])) return;
        mean += each[g] / WATCH_GROUPS;
    }
    for (int g = 0; g < WATCH_GROUPS; g++) square += (each[g] - mean) * (each[g] - mean);
    const double half = JOINED * w->dt_s + QUANTILE * sqrt((WATCH_GROUPS - 1.0) / WATCH_GROUPS * square);
    if (half > WORST * w->dt_s || fabs(all) + half > LARGEST / w->column.pole_rad_s) return;
    r->skew_known = 1;
    r->skew_s = -all;
    r->skew_half_s = half;
}

void watch_skew_row(driveid_watch *w, const double *row, const double *z, double dt_s) {
    watch_skew *s = &w->skew;
    if (s->terms == 0) return;
    double v[WATCH_SKEW];
    const unsigned n = s->terms + 1u;
    memcpy(v, row, w->params * sizeof *v);
    for (unsigned k = w->params; k < s->terms; k++) v[k] = z[s->column[k - w->params]];
    v[n - 1] = row[w->params];
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j <= i; j++) s->sum[s->group][i][j] += v[i] * v[j];
    s->motion_s += dt_s;
    s->block_s += dt_s;
    if (s->block_s < BLOCK_S) return;
    s->block_s = 0;
    answer(w);
    s->group = (uint8_t)((s->group + 1) % WATCH_GROUPS);
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j <= i; j++) s->sum[s->group][i][j] *= KEEP;
}
