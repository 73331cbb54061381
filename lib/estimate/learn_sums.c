/* SPDX-License-Identifier: Apache-2.0 */
#include "learn.h"

#include <math.h>
#include <string.h>

#include "base/solve.h"

#define NOISE_TURNS 20   /* of the inverse iteration: each wins the ratio of the two smallest roots */
#define SCALE_LEAST 1e-6 /* of the known side's mean square must be its own */

static void close_block(learn_sums *sums, unsigned p) {
    for (unsigned i = 0; i < p; i++)
        for (unsigned j = 0; j < p; j++)
            sums->outer[i * DRIVEID_THETA_MAX + j] += sums->open[i] * sums->open[j]
                + (sums->blocks > 0 ? 0.5 * (sums->open[i] * sums->before[j] + sums->before[i] * sums->open[j]) : 0);
    memcpy(sums->before, sums->open, sizeof sums->before);
    memset(sums->open, 0, sizeof sums->open);
    sums->rows_scored += sums->open_rows;
    sums->blocks++;
    sums->open_rows = 0;
    sums->open_s = 0;
    if (sums->blocks < LEARN_BLOCKS_MOST) return;
    for (unsigned i = 0; i < p * DRIVEID_THETA_MAX; i++) sums->outer[i] /= 2; /* the first ones were taken with a poor theta */
    sums->rows_scored /= 2;
    sums->blocks /= 2;
}

static void forget(learn_sums *sums, unsigned p, double decay) {
    for (unsigned i = 0; i <= p; i++)
        for (unsigned j = 0; j <= p; j++) sums->s[i * LEARN_WIDE + j] *= decay;
    for (unsigned i = 0; i < p; i++)
        for (unsigned j = 0; j < p; j++) sums->outer[i * DRIVEID_THETA_MAX + j] *= decay;
    sums->weight *= decay;
    sums->weight2 *= decay * decay;
    sums->rows_scored *= decay;
    sums->blocks *= decay;
}

/* Column that stands for column i. */
static unsigned instrument(const learner *self, const fsm_equation *q, unsigned i) {
    return self->instruments && q->known && (int)i == q->output ? q->params : i;
}

/* Of the instrument, so that it is as large as the column. */
static double size_of_instrument(const learner *self, const fsm_equation *q, const double *s, unsigned i) {
    const double own = s[i * (LEARN_WIDE + 1)], other = s[instrument(self, q, i) * (LEARN_WIDE + 1)];
    return own > 0 && other > 0 ? sqrt(own / other) : 1;
}

void learn_sums_row(learner *self, unsigned e, unsigned k, const double *x, double dt_s, double decay) {
    const fsm_equation *q = &self->common.equation[e];
    learn_sums *sums = &self->sums[k][e];
    const unsigned p = q->params;
    if (decay < 1) forget(sums, p, decay);
    for (unsigned i = 0; i <= p; i++)
        for (unsigned j = 0; j <= p; j++) sums->s[i * LEARN_WIDE + j] += x[i] * x[j];
    sums->weight++;
    sums->weight2++;
    if (!self->known[k]) return;
    double residual = x[p];
    for (unsigned i = 0; i < p; i++) residual -= x[i] * self->theta[k][q->param[i]];
    for (unsigned i = 0; i < p; i++) sums->open[i] += x[instrument(self, q, i)] * residual - (self->homogeneous ? self->shift[k][i] : 0);
    sums->open_rows++;
    sums->open_s += dt_s;
    if (sums->open_s >= self->block_s[k]) close_block(sums, p);
}

static void each(learner *self, void (*work)(learn_sums *, unsigned, double), double value) {
    for (unsigned k = 0; k < self->common.stages; k++)
        for (unsigned e = 0; e < self->common.regression.equations; e++) work(&self->sums[k][e], self->common.equation[e].params, value);
}

static void skip(learn_sums *sums, unsigned p, double value) {
    (void)p, (void)value;
    memset(sums->open, 0, sizeof sums->open);
    memset(sums->before, 0, sizeof sums->before);
    sums->open_rows = 0;
    sums->open_s = 0;
}

static void clear(learn_sums *sums, unsigned p, double value) {
    (void)p, (void)value;
    memset(sums, 0, sizeof *sums);
}

void learn_sums_forget(learner *self, double factor) { each(self, forget, factor); }
void learn_sums_skip(learner *self) { each(self, skip, 0); }
void learn_sums_clear(learner *self) { each(self, clear, 0); }

static double residual_square(const fsm_equation *q, const double *s, const double *theta) {
    const unsigned p = q->params;
    double sum = 0;
    for (unsigned i = 0; i <= p; i++)
        for (unsigned j = 0; j <= p; j++)
            sum += (i < p ? -theta[q->param[i]] : 1) * (j < p ? -theta[q->param[j]] : 1) * s[i * LEARN_WIDE + j];
    return fmax(sum, 0);
}

/* What the known side holds beyond the columns other than the output: without it (a constant torque beside a constant load) the equation also holds
 * with its output's parameter zero, and nothing has a scale. */
static int has_scale(const fsm_equation *q, const double *s) {
    double a[LEARN_WIDE * LEARN_WIDE], inverse[LEARN_WIDE * LEARN_WIDE], pivot[LEARN_WIDE];
    int column[LEARN_WIDE], n = 0;
    if (!q->known || q->output < 0) return 1;
    for (int i = 0; i <= q->params; i++)
        if (i != q->output) column[n++] = i;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) a[i * n + j] = s[column[i] * LEARN_WIDE + column[j]];
    driveid_solve_inverse(a, n, SCALE_LEAST, inverse, pivot);
    return pivot[n - 1] > SCALE_LEAST;
}

/* Variance of the channel's noise: the smallest mu with (S - mu N) v = 0, by inverse iteration; and what that noise makes of the scores. */
static double noise_of(learner *self, unsigned k) {
    const fsm_equation *q = &self->common.equation[0];
    const int p = q->params, n = p + 1;
    const double *s = self->sums[k][0].s, *moment = self->moment[k];
    double a[LEARN_WIDE * LEARN_WIDE], inverse[LEARN_WIDE * LEARN_WIDE], pivot[LEARN_WIDE], theta[DRIVEID_THETA_MAX] = {0};
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) a[i * n + j] = s[i * LEARN_WIDE + j];
    if (driveid_solve_inverse(a, n, 1e-15, inverse, pivot) < n) return 0;
    for (int turn = 0; turn < NOISE_TURNS; turn++) {
        double along[LEARN_WIDE], next[LEARN_WIDE];
        for (int i = 0; i < n; i++) {
            along[i] = moment[i * LEARN_WIDE + p];
            for (int j = 0; j < p; j++) along[i] -= moment[i * LEARN_WIDE + j] * theta[q->param[j]];
        }
        for (int i = 0; i < n; i++) {
            next[i] = 0;
            for (int j = 0; j < n; j++) next[i] += inverse[i * n + j] * along[j];
        }
        if (!(fabs(next[p]) > 0)) return 0;
        for (int i = 0; i < p; i++) theta[q->param[i]] = -next[i] / next[p];
    }
    const double expected = residual_square(q, moment, theta);
    const double noise = expected > 0 ? residual_square(q, s, theta) / self->sums[k][0].weight / expected : 0;
    for (int i = 0; i < p; i++) {
        double along = moment[i * LEARN_WIDE + p];
        for (int j = 0; j < p; j++) along -= moment[i * LEARN_WIDE + j] * theta[q->param[j]];
        self->shift[k][i] = noise * along;
    }
    return noise;
}

/* theta, H, rank of all equations together, each weighted by its residual's variance; noise: of the channel, where it is taken off. */
static void least_squares(const learner *self, unsigned k, const double *variance, double noise, double *h, fsm_solution *out) {
    const driveid_svf_common *common = &self->common;
    const int p = common->regression.params;
    double normal[DRIVEID_THETA_MAX * DRIVEID_THETA_MAX] = {0}, cross[DRIVEID_THETA_MAX * DRIVEID_THETA_MAX] = {0};
    double right[DRIVEID_THETA_MAX] = {0}, scale[DRIVEID_THETA_MAX] = {0};
    for (int e = 0; e < common->regression.equations; e++) {
        const fsm_equation *q = &common->equation[e];
        const double *s = self->sums[k][e].s, *moment = self->moment[k], off = noise * self->sums[k][e].weight;
        for (int i = 0; i < q->params; i++) {
            const unsigned z = instrument(self, q, (unsigned)i);
            const double size = size_of_instrument(self, q, s, (unsigned)i) / variance[e];
            right[q->param[i]] += size * (s[z * LEARN_WIDE + q->params] - off * moment[z * LEARN_WIDE + q->params]);
            for (int j = 0; j < q->params; j++) {
                normal[q->param[i] * p + q->param[j]] += s[i * LEARN_WIDE + j] / variance[e];
                cross[q->param[i] * p + q->param[j]] += size * (s[z * LEARN_WIDE + j] - off * moment[z * LEARN_WIDE + j]);
            }
        }
    }
    driveid_solve_inverse(normal, p, FSM_SMALL, h, out->pivot);
    for (int e = 0; e < common->regression.equations; e++) {
        const fsm_equation *q = &common->equation[e];
        if (has_scale(q, self->sums[k][e].s)) continue;
        for (int i = 0; i < q->params; i++) out->pivot[q->param[i]] = 0;
    }
    for (int i = 0; i < p; i++) scale[i] = out->pivot[i] > 0 ? 1 / sqrt(normal[i * p + i]) : 0;
    const int plain = !self->instruments && !self->homogeneous;
    if (!plain && !driveid_solve_general(cross, p, scale, h)) memset(out->pivot, 0, sizeof out->pivot);
    out->rank = 0;
    out->condition = 1;
    for (int i = 0; i < p; i++) {
        out->theta[i] = 0;
        for (int j = 0; j < p; j++) out->theta[i] += h[i * p + j] * right[j];
        out->rank += out->pivot[i] > 0;
        if (out->pivot[i] > 0) out->condition = fmax(out->condition, 1 / out->pivot[i]);
    }
}

/* Bound of what noise of the differentiated channel can have taken from theta: all of the residual's variance in the output's column. */
static void add_bias(const fsm_equation *q, int p, double weight, double square, double variance, const double *h, fsm_solution *out) {
    if (q->output < 0) return;
    const int o = q->param[q->output];
    const double theta = out->theta[o];
    if (!(fabs(theta) > 0)) return;
    for (int i = 0; i < p; i++)
        for (int j = 0; j < p; j++) {
            const double size = weight * square / (theta * variance);
            out->cov[i * p + j] += h[i * p + o] * h[j * p + o] * size * size;
        }
}

static void cover(const learner *self, unsigned k, const double *variance, const double *h, fsm_solution *out) {
    const driveid_svf_common *common = &self->common;
    const int p = common->regression.params;
    double score[DRIVEID_THETA_MAX * DRIVEID_THETA_MAX] = {0}, left[DRIVEID_THETA_MAX * DRIVEID_THETA_MAX];
    out->freedom = out->rows = INFINITY;
    for (int e = 0; e < common->regression.equations; e++) {
        const fsm_equation *q = &common->equation[e];
        const learn_sums *sums = &self->sums[k][e];
        const double scale = sums->weight2 / sums->rows_scored / (variance[e] * variance[e]);
        const double whole_square = residual_square(q, sums->s, out->theta) / (variance[e] * variance[e]);
        for (int i = 0; i < q->params; i++)
            for (int j = 0; j < q->params; j++)
                score[q->param[i] * p + q->param[j]] += self->correlated ? whole_square * sums->s[i * LEARN_WIDE + j]
                    : size_of_instrument(self, q, sums->s, (unsigned)i) * size_of_instrument(self, q, sums->s, (unsigned)j) * scale * fmax(sums->outer[i * DRIVEID_THETA_MAX + j], i == j ? 0 : -INFINITY);
        out->freedom = fmin(out->freedom, sums->blocks / 1.5 - q->params); /* neighbours share */
        out->rows = fmin(out->rows, sums->weight * sums->weight / sums->weight2);
        double whole = sums->s[q->params * LEARN_WIDE + q->params];
        for (int i = 0; i < q->params; i++) whole = fmax(whole, out->theta[q->param[i]] * out->theta[q->param[i]] * sums->s[i * LEARN_WIDE + i]);
        for (int i = 0; i < q->params && whole > 0; i++)
            out->share[q->param[i]] = fmax(out->share[q->param[i]], sqrt(sums->s[i * LEARN_WIDE + i] / whole));
    }
    for (int i = 0; i < p; i++)
        for (int j = 0; j < p; j++) {
            left[i * p + j] = 0;
            for (int c = 0; c < p; c++) left[i * p + j] += h[i * p + c] * score[c * p + j];
        }
    for (int i = 0; i < p; i++)
        for (int j = 0; j < p; j++) {
            out->cov[i * p + j] = 0;
            for (int c = 0; c < p; c++) out->cov[i * p + j] += left[i * p + c] * h[j * p + c];
        }
    for (int e = 0; e < common->regression.equations; e++) {
        const learn_sums *sums = &self->sums[k][e];
        const double square = residual_square(&common->equation[e], sums->s, out->theta) / sums->weight;
        if (e == 0) out->residual_rms = sqrt(square);
        if (!self->instruments && !self->homogeneous) add_bias(&common->equation[e], p, sums->weight, square, variance[e], h, out);
    }
}

static int solve_stage(learner *self, const learn_method *method, unsigned k, fsm_solution *out) {
    const driveid_svf_common *common = &self->common;
    const int equations = common->regression.equations;
    double variance[DRIVEID_EQUATIONS_MAX], h[DRIVEID_THETA_MAX * DRIVEID_THETA_MAX], least_blocks = INFINITY;
    memset(out, 0, sizeof *out);
    for (int e = 0; e < equations; e++) {
        const learn_sums *sums = &self->sums[k][e];
        if (sums->weight < 2 * common->equation[e].params + 2) return 0;
        variance[e] = equations > 1 ? fmax(sums->s[common->equation[e].params * (LEARN_WIDE + 1)] / sums->weight, 1e-300) : 1;
        least_blocks = fmin(least_blocks, sums->blocks);
    }
    least_squares(self, k, variance, self->homogeneous ? noise_of(self, k) : 0, h, out);
    for (int e = 0; e < equations && equations > 1; e++)
        variance[e] = fmax(residual_square(&common->equation[e], self->sums[k][e].s, out->theta) / self->sums[k][e].weight, 1e-20 * variance[e]);
    if (equations > 1) least_squares(self, k, variance, 0, h, out);
    if (method->solution) method->solution(self, out->theta, h, variance);
    memcpy(self->theta[k], out->theta, sizeof self->theta[k]);
    self->known[k] = 1;
    if (least_blocks < LEARN_BLOCKS) return 0;
    cover(self, k, variance, h, out);
    out->windows = 1;
    return 1;
}

/* Logarithm of the interval's volume relative to theta. */
static double size_of(const fsm_solution *s, int p) {
    double sum = 0;
    for (int i = 0; i < p; i++) sum += s->pivot[i] > 0 ? 0.5 * log(fmax(s->cov[i * p + i], 1e-300)) : 50;
    return sum;
}

int learn_solve(learner *self, const learn_method *method, fsm_solution *out) {
    const int p = self->common.regression.params, before = self->common.chosen[0];
    fsm_solution one;
    double least = INFINITY;
    int found = 0;
    for (unsigned k = 0; k < self->common.stages; k++) {
        if (!solve_stage(self, method, k, &one)) continue;
        const double size = size_of(&one, p) - ((int)k == before ? 0.2 : 0);
        if (found && !(size < least)) continue;
        least = size;
        found = 1;
        *out = one;
        self->common.chosen[0] = (int8_t)k;
    }
    return found;
}
