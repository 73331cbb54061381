/* SPDX-License-Identifier: Apache-2.0 */
/* Which candidate takes most of the residual, beyond chance and beyond what the reference may be off by: the likelihood of each beside a base whose
 * parameters are spread as the reference is. */
#include <math.h>
#include <string.h>

#include "model_watch_state.h"

#define ROWS_ALIKE 6.0   /* neighbouring rows behind one filter say the same */
#define T2_LEAST 50.0    /* seven deviations: some 90 candidates are looked at for years */
#define T2_AGAIN 16.0    /* four: of one that earlier rows named already */
#define NEARLY 0.97      /* of the best one's gain: not told apart */
#define EVIDENCE 12.0    /* nor by less than this difference of twice the log likelihood */
#define SPREAD_LEAST 0.005 /* of the equation's largest term: a standard deviation that any reference has */

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
        const unsigned at = c->first + i;
        zr[i] = w->zb[w->params][at];
        for (unsigned p = 0; p < w->params; p++) zr[i] -= w->zb[p][at] * theta[p];
        for (unsigned j = i; j < c->columns; j++) zz[i * WATCH_EACH + j] = zz[j * WATCH_EACH + i] = w->zz[j - i][at];
    }
}

static double statistic(double taken, double left, double rows, unsigned columns) {
    return taken / (columns * fmax(left, 1e-9 * taken) * ROWS_ALIKE / fmax(rows, 1));
}

/* The equation's own terms, as free as the weights say: factor of their sums, what they make of r, and r'r without their part. */
typedef struct base_part {
    int ok;
    double l[WATCH_BASE * WATCH_BASE], lr[WATCH_BASE], rr;
} base_part;

static base_part base_of(const driveid_watch *w, const double *br, double rr, const double *weight) {
    base_part b;
    for (unsigned i = 0; i < w->params; i++) {
        memcpy(b.l + i * WATCH_BASE, w->bb[i], w->params * sizeof(double));
        b.l[i * WATCH_BASE + i] += weight[i];
        b.lr[i] = br[i];
    }
    b.ok = factor(b.l, w->params, WATCH_BASE);
    b.rr = rr;
    if (!b.ok) return b;
    forward(b.l, w->params, WATCH_BASE, b.lr);
    for (unsigned i = 0; i < w->params; i++) b.rr -= b.lr[i] * b.lr[i];
    b.rr = fmax(b.rr, 0);
    return b;
}

/* What a candidate takes of r'r after the base has taken its part. */
static double gain_beyond(const driveid_watch *w, const watch_candidate *c, const double *theta, const base_part *b) {
    double lz[WATCH_EACH][WATCH_BASE], zz[WATCH_EACH * WATCH_EACH], zr[WATCH_EACH];
    products(w, c, theta, zz, zr);
    for (unsigned i = 0; i < c->columns; i++) {
        for (unsigned p = 0; p < w->params; p++) lz[i][p] = w->zb[p][c->first + i];
        forward(b->l, w->params, WATCH_BASE, lz[i]);
    }
    for (unsigned i = 0; i < c->columns; i++) {
        for (unsigned p = 0; p < w->params; p++) zr[i] -= lz[i][p] * b->lr[p];
        for (unsigned j = 0; j < c->columns; j++)
            for (unsigned p = 0; p < w->params; p++) zz[i * WATCH_EACH + j] -= lz[i][p] * lz[j][p];
    }
    return fmin(gain(zz, zr, c->columns), b->rr);
}

static double gain_alone(const driveid_watch *w, const watch_candidate *c, const double *theta) {
    double zz[WATCH_EACH * WATCH_EACH], zr[WATCH_EACH];
    products(w, c, theta, zz, zr);
    return gain(zz, zr, c->columns);
}

/* Spread of each reference as a weight of the base: the file's or the answer's interval, at least a part of the equation's largest term. */
static void weights(const driveid_watch *w, double drive, double row_variance, double *weight) {
    for (unsigned i = 0; i < w->params; i++) {
        const double floor2 = SPREAD_LEAST * SPREAD_LEAST * drive / fmax(w->bb[i][i], 1e-300);
        weight[i] = row_variance * ROWS_ALIKE / fmax(w->sigma[i] * w->sigma[i], floor2);
    }
}

typedef struct gains { double alone[WATCH_CANDIDATES], beyond[WATCH_CANDIDATES]; uint8_t allowed[WATCH_CANDIDATES], certain[WATCH_CANDIDATES]; } gains;

int watch_alike(const driveid_watch *w, int a, int b) {
    if (a < 0 || b < 0) return a == b;
    return w->candidate[a].effect == w->candidate[b].effect && w->candidate[a].order == w->candidate[b].order;
}

static double least_t2(const driveid_watch *w, unsigned k) { return w->name >= 0 && watch_alike(w, (int)k, w->name) ? T2_AGAIN : T2_LEAST; }

static int certain(const driveid_watch *w, unsigned k, double taken, double left) {
    return statistic(taken, left, w->weight, w->candidate[k].columns) >= least_t2(w, k);
}

static int any_alone(const driveid_watch *w, const double *theta, double rr, gains *g) {
    int any = 0;
    for (unsigned k = 0; k < w->candidates; k++) {
        g->alone[k] = gain_alone(w, &w->candidate[k], theta);
        g->certain[k] = certain(w, k, g->alone[k], rr - g->alone[k]);
        any |= g->certain[k];
    }
    return any;
}

/* With a free base: no error of the reference in disguise, and the level of the noise; then with one as free as its spread. */
static base_part weigh_all(const driveid_watch *w, const double *theta, const double *br, double rr, double drive, gains *g) {
    double weight[WATCH_BASE] = {0};
    const base_part free_base = base_of(w, br, rr, weight);
    double least = free_base.rr;
    for (unsigned k = 0; k < w->candidates; k++) {
        const watch_candidate *c = &w->candidate[k];
        const double more = free_base.ok && !c->own ? gain_beyond(w, c, theta, &free_base) : 0;
        g->allowed[k] = c->own || certain(w, k, more, free_base.rr - more);
        least = fmin(least, free_base.rr - more);
    }
    weights(w, drive, fmax(least, 1e-9 * rr) / w->weight, weight);
    const base_part base = base_of(w, br, rr, weight);
    for (unsigned k = 0; k < w->candidates; k++) {
        g->beyond[k] = base.ok ? gain_beyond(w, &w->candidate[k], theta, &base) : 0;
        g->certain[k] = g->certain[k] && certain(w, k, g->beyond[k], base.rr - g->beyond[k]);
    }
    return base;
}

static void tie(const driveid_watch *w, watch_finding *f, unsigned k) {
    const unsigned effect = w->candidate[k].effect;
    if (effect == w->candidate[f->best].effect || f->ties >= DRIVEID_WATCH_TIES) return;
    for (unsigned i = 0; i < f->ties; i++)
        if (f->tie[i] == effect) return;
    f->tie[f->ties++] = (uint8_t)effect;
}

/* A change of what the model has, then fewest columns, then the first of the list. */
static int plainer(const watch_candidate *a, const watch_candidate *b) { return a->own != b->own ? a->own > b->own : a->columns < b->columns; }

/* Of what has the said name: that candidate itself, else the one that takes most. */
static int keeps(const driveid_watch *w, const gains *g, int k, int so_far) {
    if (w->said < 0 || w->candidate[k].effect != w->candidate[w->said].effect || so_far == w->said) return 0;
    return k == w->said || so_far < 0 || g->beyond[k] > g->beyond[so_far];
}

/* The plainest of those that the sums cannot tell from the best. */
static void choose(const driveid_watch *w, const gains *g, const base_part *base, double rr, watch_finding *f) {
    double most = 0, contender = 0;
    for (unsigned k = 0; k < w->candidates; k++) {
        if (!g->certain[k]) continue;
        if (g->allowed[k]) most = fmax(most, g->beyond[k]);
        contender = fmax(contender, g->beyond[k]);
    }
    if (!(most > 0)) return;
    const double near = fmax((1 - NEARLY) * most, EVIDENCE * ROWS_ALIKE * fmax(base->rr - most, 1e-9 * rr) / w->weight);
    for (unsigned k = 0; k < w->candidates; k++) {
        if (!g->allowed[k] || g->beyond[k] < most - near) continue;
        if (f->best < 0 || plainer(&w->candidate[k], &w->candidate[f->best])) f->best = (int)k;
        if (keeps(w, g, (int)k, f->said)) f->said = (int)k;
    }
    for (unsigned k = 0; k < w->candidates; k++)
        if (g->allowed[k] && g->beyond[k] >= most - near) tie(w, f, k);
    f->open = contender > most + near;
    f->share = base->rr > 0 ? g->beyond[f->best] / base->rr : 0;
    f->said_share = base->rr > 0 && f->said >= 0 ? g->beyond[f->said] / base->rr : 0;
    f->size2 = g->alone[f->best] / w->weight;
}

watch_finding watch_find(const driveid_watch *w, const double *theta) {
    const unsigned p = w->params;
    watch_finding f = {.best = -1, .said = -1};
    if (!(w->weight > 0)) return f;
    double rr = w->bb[p][p], drive = rr, br[WATCH_BASE] = {0};
    for (unsigned i = 0; i < p; i++) {
        br[i] = w->bb[i][p];
        for (unsigned j = 0; j < p; j++) br[i] -= w->bb[i][j] * theta[j];
        rr -= theta[i] * (w->bb[i][p] + br[i]);
        drive = fmax(drive, theta[i] * theta[i] * w->bb[i][i]);
    }
    rr = fmax(rr, 0);
    f.r2 = rr / w->weight;
    f.drive2 = drive / w->weight;
    gains g;
    if (!any_alone(w, theta, rr, &g)) return f;
    const base_part base = weigh_all(w, theta, br, rr, drive, &g);
    choose(w, &g, &base, rr, &f);
    return f;
}
