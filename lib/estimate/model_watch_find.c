/* SPDX-License-Identifier: Apache-2.0 */
/* Which candidate takes most of the residual, beyond chance and beyond what the reference may be off by. */
#include <math.h>
#include <string.h>

#include "model_watch_state.h"

#define ROWS_ALIKE 6.0   /* neighbouring rows behind one filter say the same */
#define T2_LEAST 50.0    /* seven deviations: some 90 candidates are looked at for years */
#define NEARLY 0.97      /* of the best one's gain: then the simpler one */

/* Cholesky of a small symmetric matrix, in place; 0 where it has no full rank. */
static int factor(double *a, unsigned n, unsigned stride) {
    for (unsigned i = 0; i < n; i++) {
        const double whole = a[i * stride + i];
        for (unsigned j = 0; j <= i; j++) {
            double sum = a[i * stride + j];
            for (unsigned k = 0; k < j; k++) sum -= a[i * stride + k] * a[j * stride + k];
            if (i == j) {
                if (!(sum > 1e-6 * whole)) return 0;
                a[i * stride + i] = sqrt(sum);
            } else {
                a[i * stride + j] = sum / a[j * stride + j];
            }
        }
    }
    return 1;
}

/* L x = b, in place. */
static void forward(const double *l, unsigned n, unsigned stride, double *b) {
    for (unsigned i = 0; i < n; i++) {
        for (unsigned k = 0; k < i; k++) b[i] -= l[i * stride + k] * b[k];
        b[i] /= l[i * stride + i];
    }
}

/* What the columns take of r'r: zr' (zz)^-1 zr. */
static double gain(double *zz, double *zr, unsigned n) {
    double sum = 0;
    if (!factor(zz, n, WATCH_EACH)) return 0;
    forward(zz, n, WATCH_EACH, zr);
    for (unsigned i = 0; i < n; i++) sum += zr[i] * zr[i];
    return sum;
}

static void products(const driveid_watch *w, const watch_candidate *c, const double *theta, double *zz, double *zr) {
    for (unsigned i = 0; i < c->columns; i++) {
        const double *zb = w->zb[c->first + i];
        zr[i] = zb[w->params];
        for (unsigned p = 0; p < w->params; p++) zr[i] -= zb[p] * theta[p];
        for (unsigned j = 0; j < c->columns; j++) zz[i * WATCH_EACH + j] = w->zz[c->first + i][j];
    }
}

/* The same after the equation's own terms have taken theirs: l is the factor of their sums, lr what they make of r. */
static void without_base(const driveid_watch *w, const watch_candidate *c, const double *l, const double *lr, double *zz, double *zr) {
    double lz[WATCH_EACH][WATCH_BASE];
    for (unsigned i = 0; i < c->columns; i++) {
        memcpy(lz[i], w->zb[c->first + i], w->params * sizeof(double));
        forward(l, w->params, WATCH_BASE, lz[i]);
    }
    for (unsigned i = 0; i < c->columns; i++) {
        for (unsigned p = 0; p < w->params; p++) zr[i] -= lz[i][p] * lr[p];
        for (unsigned j = 0; j < c->columns; j++)
            for (unsigned p = 0; p < w->params; p++) zz[i * WATCH_EACH + j] -= lz[i][p] * lz[j][p];
    }
}

static double statistic(double taken, double left, double rows, unsigned columns) {
    return taken / (columns * fmax(left, 1e-9 * taken) * ROWS_ALIKE / fmax(rows, 1));
}

watch_finding watch_find(const driveid_watch *w, const double *theta) {
    const unsigned p = w->params;
    watch_finding f = {.best = -1};
    double rr = w->bb[p][p], drive = rr, br[WATCH_BASE] = {0}, l[WATCH_BASE * WATCH_BASE];
    for (unsigned i = 0; i < p; i++) {
        br[i] = w->bb[i][p];
        for (unsigned j = 0; j < p; j++) br[i] -= w->bb[i][j] * theta[j];
        rr -= theta[i] * (w->bb[i][p] + br[i]);
        drive = fmax(drive, theta[i] * theta[i] * w->bb[i][i]);
        memcpy(l + i * WATCH_BASE, w->bb[i], p * sizeof(double));
    }
    if (!(w->weight > 0)) return f;
    rr = fmax(rr, 0);
    f.r2 = rr / w->weight;
    f.drive2 = drive / w->weight;
    double lr[WATCH_BASE], free_rr = rr;
    memcpy(lr, br, sizeof lr);
    const int base = factor(l, p, WATCH_BASE);
    if (base) forward(l, p, WATCH_BASE, lr);
    for (unsigned i = 0; base && i < p; i++) free_rr -= lr[i] * lr[i];
    double taken[WATCH_CANDIDATES], most = 0;
    for (unsigned k = 0; k < w->candidates; k++) {
        const watch_candidate *c = &w->candidate[k];
        double zz[WATCH_EACH * WATCH_EACH], zr[WATCH_EACH];
        taken[k] = 0;
        products(w, c, theta, zz, zr);
        const double alone = gain(zz, zr, c->columns);
        if (statistic(alone, rr - alone, w->weight, c->columns) < T2_LEAST) continue;
        if (!c->own) { /* not an error of the reference in disguise */
            if (!base) continue;
            products(w, c, theta, zz, zr);
            without_base(w, c, l, lr, zz, zr);
            const double more = gain(zz, zr, c->columns);
            if (statistic(more, free_rr - more, w->weight, c->columns) < T2_LEAST) continue;
        }
        taken[k] = alone;
        most = fmax(most, alone);
    }
    for (unsigned k = 0; k < w->candidates; k++) {
        const watch_candidate *c = &w->candidate[k];
        if (!(taken[k] > 0) || taken[k] < NEARLY * most) continue;
        const int simpler = f.best < 0 || c->columns < w->candidate[f.best].columns;
        if (!simpler) continue; /* among alike ones the first of the list: what the model has, then the commonest */
        f.best = (int)k;
        f.share = rr > 0 ? taken[k] / rr : 0;
        f.t2 = statistic(taken[k], rr - taken[k], w->weight, c->columns);
    }
    return f;
}
