/* SPDX-License-Identifier: Apache-2.0 */
#include "fsm_solution.h"

#include <math.h>
#include <string.h>

#include "base/solve.h"

#define ROWS_FIRST 10.0      /* coarse rows beyond the unknowns before anything is said */
#define ROWS_LATER 50.0      /* and before a prefiltered stage is believed */
#define SCALE_LEAST 1e-6     /* of the known side's mean square must be its own */
#define CONFIRMED 0.8        /* of the first interval: half as many rows again */
#define FORGOTTEN 3.0        /* memories: a twentieth is left */
#define AGREED 50            /* answers, where the interval does not shrink: a second of motion */
#define AGREES 1e-3          /* of the value: closer than that nobody asks */
#define EXCESS 2.0           /* output noise may weigh so much more at low frequency than at high, behind a prefilter */

_Static_assert(DRIVEID_SOLVE_MAX >= FSM_PACKED && DRIVEID_SOLVE_MAX >= DRIVEID_ORDER_MAX, "DRIVEID_SOLVE_MAX is too small for DRIVEID_THETA_MAX");

void fsm_solve_initial(const fsm_equation *q, const double *s, double small, double *solved) {
    double a[DRIVEID_ORDER_MAX * DRIVEID_ORDER_MAX] = {0}, inverse[DRIVEID_ORDER_MAX * DRIVEID_ORDER_MAX], pivot[DRIVEID_ORDER_MAX];
    const int n = q->order, m = q->columns, p = q->params;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) a[i * n + j] = s[(p + i) * m + p + j];
    driveid_solve_inverse(a, n, small, inverse, pivot);
    for (int i = 0; i < n; i++)
        for (int c = 0; c < m; c++) {
            double sum = 0;
            for (int j = 0; j < n; j++) sum += inverse[i * n + j] * s[(p + j) * m + c];
            solved[i * m + c] = c >= p && c < p + n ? 0 : sum;
        }
}

void fsm_eliminate_initial(const fsm_equation *q, const double *solved, double *sums) {
    const int n = q->order, m = q->columns, p = q->params;
    for (int r = 0; r < m; r++)
        for (int c = 0; c < m; c++)
            for (int i = 0; i < n; i++) sums[r * m + c] -= sums[r * m + p + i] * solved[i * m + c];
    for (int c = 0; c < m; c++)
        for (int r = 0; r < m; r++)
            for (int i = 0; i < n; i++) sums[r * m + c] -= sums[(p + i) * m + c] * solved[i * m + r];
    for (int i = p; i < p + n; i++)
        for (int j = 0; j < m; j++) sums[i * m + j] = sums[j * m + i] = 0;
}

void fsm_pack(const fsm_equation *q, const double *full, double *packed) {
    const int n = q->params + 1, m = q->columns;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++)
            packed[i * n + j] = full[(i < n - 1 ? i : m - 1) * m + (j < n - 1 ? j : m - 1)];
}

/* With z the initial conditions' columns, c = solved: x_r - c_r z beside x_s - c_s z, symmetric in r and s. */
void fsm_eliminate_lagged(const fsm_equation *q, const double *solved, const double *g, double *out) {
    enum { CHUNK = 4 };
    const int n = q->params + 1, m = q->columns;
    for (int lag = 0; lag < FSM_LAGS; lag += CHUNK) {
        double half[DRIVEID_ORDER_MAX][FSM_PACKED][CHUNK]; /* z_i beside x_r - c_r z / 2 */
        for (int i = 0; i < q->order; i++)
            for (int r = 0; r < n; r++) {
                const double *zx = g + FSM_LAGS * (FSM_PAIRS(n + i) + r) + lag, *c = solved + (r < n - 1 ? r : m - 1);
                for (int l = 0; l < CHUNK; l++) half[i][r][l] = zx[l];
                for (int j = 0; j < q->order; j++) {
                    const double *zz = g + FSM_LAGS * (i > j ? FSM_PAIRS(n + i) + n + j : FSM_PAIRS(n + j) + n + i) + lag;
                    for (int l = 0; l < CHUNK; l++) half[i][r][l] -= 0.5 * c[j * m] * zz[l];
                }
            }
        for (int r = 0; r < n; r++)
            for (int s = 0; s <= r; s++) {
                const double *from = g + FSM_LAGS * (FSM_PAIRS(r) + s) + lag;
                double *to = out + FSM_LAGS * (FSM_PAIRS(r) + s) + lag;
                for (int l = 0; l < CHUNK; l++) to[l] = from[l];
                for (int i = 0; i < q->order; i++) {
                    const double cr = solved[i * m + (r < n - 1 ? r : m - 1)], cs = solved[i * m + (s < n - 1 ? s : m - 1)];
                    for (int l = 0; l < CHUNK; l++) to[l] -= cs * half[i][r][l] + cr * half[i][s][l];
                }
            }
    }
}

/* a' s a with a = (-theta, 1) */
static double quadratic(const fsm_equation *q, const double *g, const double *theta) {
    const int n = q->params + 1;
    double sum = 0;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            const double left = i < n - 1 ? -theta[q->param[i]] : 1, right = j < n - 1 ? -theta[q->param[j]] : 1;
            sum += left * right * g[i * n + j];
        }
    return sum;
}

/* The residual's lagged sums at theta, of each lag. */
static void residual_lags(const fsm_equation *q, const fsm_sums *sums, const double *theta, double *r) {
    const int n = q->params + 1;
    const double *g = sums->g;
    for (int lag = 0; lag < FSM_LAGS; lag++) r[lag] = 0;
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++, g += FSM_LAGS) {
            const double left = i < n - 1 ? -theta[q->param[i]] : 1, right = j < n - 1 ? -theta[q->param[j]] : 1;
            const double factor = (i == j ? 0.5 : 1) * left * right / sums->weight2;
            for (int lag = 0; lag < FSM_LAGS; lag++) r[lag] += factor * g[lag];
        }
}

/* Column that stands for column i as instrument. The highest derivative is the equation's output: it carries most of the encoder's noise and
 * all of the unmeasured torque, which would bias it as regressor; the known side y takes its place. */
static int instrument(const fsm_equation *q, const double *s, int i) {
    const int n = q->params + 1;
    return i == q->output && s[n * n - 1] > 0 ? n - 1 : i;
}

/* Does the known side hold more than the other columns explain without the output? If not (a constant torque beside a constant load, coasting),
 * the equation also holds with its output's parameter zero, and none of its parameters has a scale. */
static int has_scale(const fsm_equation *q, const double *s, double small) {
    double a[FSM_PACKED * FSM_PACKED] = {0}, inverse[FSM_PACKED * FSM_PACKED], pivot[FSM_PACKED];
    const int n = q->params + 1, y = n - 1;
    int column[FSM_PACKED], size = 0;
    if (!q->known || q->output < 0) return 1;
    for (int i = 0; i < y; i++)
        if (i != q->output) column[size++] = i;
    for (int i = 0; i < size; i++)
        for (int j = 0; j < size; j++) a[i * size + j] = s[column[i] * n + column[j]];
    driveid_solve_inverse(a, size, small, inverse, pivot);
    double left = s[y * n + y];
    for (int i = 0; i < size; i++)
        for (int j = 0; j < size; j++) left -= s[y * n + column[i]] * inverse[i * size + j] * s[y * n + column[j]];
    return left > SCALE_LEAST * s[y * n + y];
}

/* All equations together, each weighted by its residual variance: rank from the normal matrix, theta by instruments;
 * h[params^2] keeps the inverse of sum z phi'. */
static int solve_all(const driveid_svf_common *common, const fsm_sums *sums, const double *variance, double small,
                     double *h, fsm_solution *out) {
    const int p = common->regression.params;
    double normal[DRIVEID_THETA_MAX * DRIVEID_THETA_MAX] = {0}, cross[DRIVEID_THETA_MAX * DRIVEID_THETA_MAX] = {0};
    double right[DRIVEID_THETA_MAX] = {0}, plain[DRIVEID_THETA_MAX] = {0}, scale[DRIVEID_THETA_MAX] = {0};
    for (int e = 0; e < common->regression.equations; e++) {
        const fsm_equation *q = &common->equation[e];
        const int n = q->params + 1;
        for (int i = 0; i < n - 1; i++) {
            const int z = instrument(q, sums[e].s, i);
            const double size = z == i ? 1 : sqrt(sums[e].s[i * n + i] / sums[e].s[n * n - 1]); /* y as large as what it stands for */
            right[q->param[i]] += size * sums[e].s[z * n + n - 1] / variance[e];
            plain[q->param[i]] += sums[e].s[i * n + n - 1] / variance[e];
            for (int j = 0; j < n - 1; j++) {
                normal[q->param[i] * p + q->param[j]] += sums[e].s[i * n + j] / variance[e];
                cross[q->param[i] * p + q->param[j]] += size * sums[e].s[z * n + j] / variance[e];
            }
        }
    }
    driveid_solve_inverse(normal, p, small, h, out->pivot);
    for (int e = 0; e < common->regression.equations; e++) {
        const fsm_equation *q = &common->equation[e];
        for (int i = 0; i < q->params && !has_scale(q, sums[e].s, small); i++) out->pivot[q->param[i]] = 0;
    }
    out->rank = 0;
    for (int i = 0; i < p; i++) out->rank += out->pivot[i] > 0;
    for (int i = 0; i < p; i++) scale[i] = out->pivot[i] > 0 ? 1 / sqrt(normal[i * p + i]) : 0;
    out->instruments = driveid_solve_general(cross, p, scale, out->cov);
    if (out->instruments) memcpy(h, out->cov, sizeof(double) * (size_t)(p * p));
    out->condition = 1;
    for (int i = 0; i < p; i++) {
        double sum = 0;
        for (int j = 0; j < p; j++) sum += h[i * p + j] * (out->instruments ? right[j] : plain[j]);
        out->theta[i] = sum;
        if (out->pivot[i] > 0) out->condition = fmax(out->condition, 1 / out->pivot[i]);
    }
    return out->rank;
}

/* Positive definite, so the sum over lags is too. */
static double parzen(double x) {
    return x < 0.5 ? 1 - 6 * x * x * (1 - x) : 2 * (1 - x) * (1 - x) * (1 - x);
}

/* Lags that the window must reach: well beyond the last one at which the residual is clearly correlated. */
static int lags_needed(const double *r, double rows, int *enough) {
    int last = 0;
    for (int lag = 1; lag < FSM_LAGS; lag++)
        if (fabs(r[lag]) > 3 * fabs(r[0]) / sqrt(rows)) last = lag;
    const int wanted = 4 + 3 * last < FSM_LAGS ? 4 + 3 * last : FSM_LAGS, most = (int)fmax(1, rows / 6);
    *enough = wanted <= most;
    return *enough ? wanted : most;
}

/* Noise of the differentiated channel reaches the residual as |A(jw)|^2 / (w^2 + pole^2)^n. Where that rises towards low frequency the lags kept here are
 * too short to see all of it: how often its level at high frequency it reaches, 1 where it does not rise. */
static double noise_excess(const driveid_svf_common *common, int e, double pole_rad_s, const double *theta) {
    const driveid_regression *r = &common->regression;
    const int order = common->equation[e].order;
    double a[DRIVEID_ORDER_MAX + 1] = {0};
    int channel = -1;
    for (int i = 0; i < r->terms; i++)
        if (r->term[i].equation == e && r->term[i].derivative == order) channel = r->term[i].channel;
    for (int i = 0; i < r->terms; i++) {
        const driveid_term *t = &r->term[i];
        if (t->equation == e && t->channel == channel) a[t->derivative] += t->factor * (t->param == DRIVEID_TERM_KNOWN ? 1 : theta[t->param]);
    }
    double excess = 1;
    for (double w = 0.1 * pole_rad_s; w < 5 * pole_rad_s; w *= 2) {
        double re = 0, im = 0, power = 1, gain = 1;
        for (int i = 0; i <= order; i++, power *= w) {
            if (i & 1) im += (i & 2 ? -1 : 1) * a[i] * power;
            else re += (i & 2 ? -1 : 1) * a[i] * power;
        }
        for (int i = 0; i < common->sections - 2; i++) gain *= w * w + pole_rad_s * pole_rad_s;
        const int flat = common->sections - 2 == order;
        const double plateau = flat ? a[order] * a[order] : 0;
        excess = fmax(excess, (re * re + im * im) / (plateau * gain));
    }
    return excess;
}

typedef enum correlation { RECORD_TOO_SHORT, BEYOND_THE_LAGS, SEEN_WHOLE } correlation; /* of a residual */

/* Long-run covariance of one equation's score, into score[params^2] (theta order): sum of r(lag) Gamma(lag), Parzen window.
 * Where the noise rises towards low frequency the regressors meet something between its levels: the geometric mean is taken.
 * What the fit takes out of the residual it takes out near the regressors' own frequencies, so the window's band, not the whole record,
 * pays for the unknowns. Returns the degrees of freedom left. */
static double add_score(const driveid_svf_common *common, const fsm_sums *sums, int e, correlation *seen, int instruments, double variance, const double *theta, double *score) {
    const fsm_equation *q = &common->equation[e];
    const int p = common->regression.params, n = q->params + 1;
    const double coarse = sums->coarse, rows = sums->rows;
    double r[FSM_LAGS];
    residual_lags(q, sums, theta, r);
    const double pieces = q->order > 0 ? sums->spent / q->order - 1 : 0; /* ends at which a lag finds no partner; beyond 0.6 too few pairs speak */
    for (int lag = 1; lag < FSM_LAGS && pieces > 0; lag++) r[lag] /= fmax(0.6, 1 - lag * pieces / rows);
    int enough;
    const int lags = lags_needed(r, rows, &enough);
    double tail = 0;
    for (int lag = FSM_LAGS / 4; lag < FSM_LAGS; lag++) tail += r[lag] / (FSM_LAGS - FSM_LAGS / 4);
    *seen = !enough ? RECORD_TOO_SHORT : tail < 0.12 * r[0] ? SEEN_WHOLE : BEYOND_THE_LAGS;
    const double band = fmin(rows, 3.7 * rows / lags), freedom = fmax(1, band - q->params - sums->spent);
    const double rise = sums->pole_rad_s > 0 ? sqrt(fmin(noise_excess(common, e, sums->pole_rad_s, theta), EXCESS)) : 1;
    const double scale = rise * band / freedom / (coarse * coarse * variance * variance);
    const double replaced = q->output >= 0 && sums->s[n * n - 1] > 0 ? sqrt(sums->s[q->output * n + q->output] / sums->s[n * n - 1]) : 1;
    double share[FSM_LAGS] = {0};
    for (int lag = 0; lag < lags; lag++) share[lag] = (lag ? 1 : 0.5) * parzen((double)lag / lags) * r[lag] * scale;
    for (int i = 0; i < n - 1; i++)
        for (int j = 0; j <= i; j++) {
            const int a = instruments ? instrument(q, sums->s, i) : i, b = instruments ? instrument(q, sums->s, j) : j;
            const double *g = sums->g + FSM_LAGS * (a > b ? FSM_PAIRS(a) + b : FSM_PAIRS(b) + a);
            double sum = 0;
            for (int lag = 0; lag < FSM_LAGS; lag++) sum += share[lag] * g[lag];
            sum *= (a == i ? 1 : replaced) * (b == j ? 1 : replaced);
            score[q->param[i] * p + q->param[j]] += sum;
            if (i != j) score[q->param[j] * p + q->param[i]] += sum;
        }
    return freedom;
}

static void sandwich(int p, const double *h, const double *score, double *cov) {
    double left[DRIVEID_THETA_MAX * DRIVEID_THETA_MAX];
    for (int i = 0; i < p; i++)
        for (int j = 0; j < p; j++) {
            double sum = 0;
            for (int k = 0; k < p; k++) sum += h[i * p + k] * score[k * p + j];
            left[i * p + j] = sum;
        }
    for (int i = 0; i < p; i++)
        for (int j = 0; j < p; j++) {
            double sum = 0;
            for (int k = 0; k < p; k++) sum += left[i * p + k] * h[j * p + k];
            cov[i * p + j] = sum;
        }
}

/* How much of its equation each parameter's term carries. */
static void shares(const driveid_svf_common *common, const fsm_sums *sums, fsm_solution *out) {
    for (int e = 0; e < common->regression.equations; e++) {
        const fsm_equation *q = &common->equation[e];
        const int n = q->params + 1;
        double whole = sums[e].s[n * n - 1];
        for (int i = 0; i < n - 1; i++) whole = fmax(whole, out->theta[q->param[i]] * out->theta[q->param[i]] * sums[e].s[i * n + i]);
        for (int i = 0; i < n - 1 && whole > 0; i++)
            out->share[q->param[i]] = fmax(out->share[q->param[i]], sqrt(sums[e].s[i * n + i] / whole));
    }
}

int fsm_enough(const driveid_svf_common *common, int e, const fsm_sums *sums) {
    const fsm_equation *q = &common->equation[e];
    return sums->rows >= q->params + sums->spent + (sums->pole_rad_s > 0 ? ROWS_LATER : ROWS_FIRST);
}

double fsm_score(const driveid_svf_common *common, int e, const fsm_sums *sums, double small, const double *theta) {
    const fsm_equation *q = &common->equation[e];
    const int p = common->regression.params, n = q->params + 1;
    double own[DRIVEID_THETA_MAX], a[DRIVEID_THETA_MAX * DRIVEID_THETA_MAX] = {0}, inverse[DRIVEID_THETA_MAX * DRIVEID_THETA_MAX];
    double pivot[DRIVEID_THETA_MAX], score[DRIVEID_THETA_MAX * DRIVEID_THETA_MAX] = {0}, cov = 0;
    correlation seen;
    if (!fsm_enough(common, e, sums)) return INFINITY;
    for (int i = 0; i < n - 1; i++)
        for (int j = 0; j < n - 1; j++) a[i * (n - 1) + j] = sums->s[i * n + j];
    driveid_solve_inverse(a, n - 1, small, inverse, pivot);
    if (theta) memcpy(own, theta, sizeof own);
    if (!theta || sums->s[n * n - 1] > 0)
        for (int i = 0; i < n - 1; i++) {
            own[q->param[i]] = 0;
            for (int j = 0; j < n - 1; j++) own[q->param[i]] += inverse[i * (n - 1) + j] * sums->s[j * n + n - 1];
        }
    if (sums->pole_rad_s > 0 && !(noise_excess(common, e, sums->pole_rad_s, own) < EXCESS)) return INFINITY;
    add_score(common, sums, e, &seen, 0, 1, own, score);
    if (sums->pole_rad_s > 0 && seen != SEEN_WHOLE) return INFINITY;
    double total = 0;
    for (int i = 0; i < n - 1; i++) {
        cov = 0;
        for (int j = 0; j < n - 1; j++)
            for (int k = 0; k < n - 1; k++) cov += inverse[i * (n - 1) + j] * score[q->param[j] * p + q->param[k]] * inverse[i * (n - 1) + k];
        total += pivot[i] > 0 ? 0.5 * log(fmax(cov, 1e-300)) : 50;
    }
    return total;
}

int fsm_solve(const driveid_svf_common *common, const fsm_sums *sums, double small, fsm_solution *out) {
    const int p = common->regression.params, equations = common->regression.equations;
    double variance[DRIVEID_EQUATIONS_MAX] = {0}, h[DRIVEID_THETA_MAX * DRIVEID_THETA_MAX], score[DRIVEID_THETA_MAX * DRIVEID_THETA_MAX] = {0};
    memset(out, 0, sizeof *out);
    for (int e = 0; e < equations; e++) {
        const fsm_equation *q = &common->equation[e];
        const int n = q->params + 1;
        double trace = 0;
        if (sums[e].rows < q->params + sums[e].spent + ROWS_FIRST) return 0;
        for (int i = 0; i < n; i++) trace += sums[e].s[i * n + i];
        variance[e] = equations > 1 && trace > 0 ? trace / sums[e].weight : 1;
    }
    solve_all(common, sums, variance, small, h, out);
    for (int e = 0; e < equations && equations > 1; e++) {
        const double r = quadratic(&common->equation[e], sums[e].s, out->theta) / sums[e].weight;
        variance[e] = fmax(r, 1e-20 * variance[e]);
    }
    if (equations > 1) solve_all(common, sums, variance, small, h, out);
    out->freedom = INFINITY;
    out->rows = INFINITY;
    out->long_enough = 1;
    for (int e = 0; e < equations; e++) {
        correlation seen;
        out->freedom = fmin(out->freedom, add_score(common, &sums[e], e, &seen, out->instruments, variance[e], out->theta, score));
        out->rows = fmin(out->rows, sums[e].rows);
        if (seen == RECORD_TOO_SHORT) out->long_enough = 0;
    }
    sandwich(p, h, score, out->cov);
    shares(common, sums, out);
    out->residual_rms = sqrt(fmax(0, quadratic(&common->equation[0], sums[0].s, out->theta) / sums[0].weight));
    return 1;
}

static double student(double freedom) {
    const double v = freedom > 3 ? freedom : 3;
    return 1.96 + (2.37 + (2.82 + 2.6 / v) / v) / v;
}

/* A parameter is weak where its interval says nothing: wider than half its value, and, for one that may be zero,
 * also wider than a tenth of what drives its equation. */
static int is_weak(const driveid_svf_common *common, const fsm_solution *s, int i, double half) {
    if (!(s->pivot[i] > 0) || !(half > 0) || !isfinite(half)) return s->pivot[i] > 0 && half == 0 ? 0 : 1;
    if (half <= 0.5 * fabs(s->theta[i])) return 0;
    return !(common->regression.may_be_zero >> i & 1) || half * s->share[i] > 0.1;
}

/* The first answers come from few rows, whose residual says little of its own correlation. A parameter is trusted once its interval has shrunk, or many
 * answers have followed, while all its values lay within the interval that it began with. */
static int is_confirmed(driveid_svf_common *common, int i, const fsm_solution *s, double half) {
    const double theta = s->theta[i];
    if (s->windows || common->confirmed_mask >> i & 1) return 1;
    const double agrees = fmax(common->first_half[i], AGREES * fabs(theta));
    if (!(common->first_half[i] > 0) || fabs(theta - common->first_theta[i]) > agrees) {
        common->first_theta[i] = theta;
        common->first_half[i] = half;
        common->agreed[i] = 0;
    }
    const int shrunk = s->long_enough && half <= CONFIRMED * common->first_half[i];
    if (!shrunk && ++common->agreed[i] < AGREED) return 0;
    common->confirmed_mask |= 1u << i;
    return 1;
}

static void unconfirm(driveid_svf_common *common) {
    common->confirmed_mask = 0;
    memset(common->first_half, 0, sizeof common->first_half);
}

void fsm_silence(driveid_svf_common *common, double silence_s) {
    if (silence_s > FORGOTTEN * common->options.forgetting_s) unconfirm(common);
}

void fsm_publish(driveid_svf_common *common, int found, const fsm_solution *best, int64_t t_ns) {
    driveid_estimate *a = &common->answer;
    const int p = common->regression.params;
    if (!found) {
        common->status = DRIVEID_NOT_YET;
        return;
    }
    const double quantile = student(best->freedom);
    if (a->params == 0 || common->confirmed_restarts != a->restarts) {
        common->confirmed_restarts = a->restarts;
        unconfirm(common);
    }
    a->t_ns = t_ns;
    a->first_ns = common->first_ns;
    a->params = (uint32_t)p;
    a->samples = (uint32_t)fmin(best->rows, 4e9);
    a->valid_mask = a->weak_mask = 0;
    a->residual_rms = best->residual_rms;
    a->condition = best->condition;
    memcpy(a->cov, best->cov, sizeof a->cov);
    for (int i = 0; i < p; i++) {
        const double whole = best->share[i] > 0 ? 1 / (3 * best->share[i]) : 0;
        const double unseen = common->options.model_error * fmax(fabs(best->theta[i]), whole);
        const double half = sqrt(quantile * quantile * fmax(0, best->cov[i * p + i]) + unseen * unseen);
        a->theta[i] = best->theta[i];
        a->lo[i] = best->theta[i] - half;
        a->hi[i] = best->theta[i] + half;
        if (is_weak(common, best, i, half)) a->weak_mask |= 1u << i;
        else if (is_confirmed(common, i, best, half)) a->valid_mask |= 1u << i;
    }
    common->status = best->rank < p ? DRIVEID_RANK : a->valid_mask + 1 < 1u << p ? DRIVEID_WEAK_EXCITATION : DRIVEID_OK;
    common->watched = best->rank == p && !a->weak_mask;
    if (common->status == DRIVEID_OK && a->first_trusted_ns == 0) a->first_trusted_ns = t_ns;
}
