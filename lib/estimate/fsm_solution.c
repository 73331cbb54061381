/* SPDX-License-Identifier: Apache-2.0 */
#include "fsm_solution.h"

#include <math.h>
#include <string.h>

#include "base/solve.h"

#define ROWS_MIN 10.0        /* coarse rows beyond the unknowns before anything is said */

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

/* a' g a with a = (-theta, 1) */
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

/* Normal equations of all equations, each weighted by its residual variance; h[params^2] keeps the inverse. */
static int least_squares(const driveid_fsm_common *common, const fsm_sums *sums, const double *variance, double small,
                         double *h, fsm_solution *out) {
    const int p = common->regression.params;
    double normal[DRIVEID_THETA_MAX * DRIVEID_THETA_MAX] = {0}, right[DRIVEID_THETA_MAX] = {0};
    for (int e = 0; e < common->regression.equations; e++) {
        const fsm_equation *q = &common->equation[e];
        const int n = q->params + 1;
        for (int i = 0; i < n - 1; i++) {
            right[q->param[i]] += sums->s[e][i * n + n - 1] / variance[e];
            for (int j = 0; j < n - 1; j++) normal[q->param[i] * p + q->param[j]] += sums->s[e][i * n + j] / variance[e];
        }
    }
    out->rank = driveid_solve_inverse(normal, p, small, h, out->pivot);
    out->condition = 1;
    for (int i = 0; i < p; i++) {
        double sum = 0;
        for (int j = 0; j < p; j++) sum += h[i * p + j] * right[j];
        out->theta[i] = sum;
        if (out->pivot[i] > 0) out->condition = fmax(out->condition, 1 / out->pivot[i]);
    }
    return out->rank;
}

/* Long-run covariance of one equation's score, into score[params^2] (theta order): sum of r(lag) Gamma(lag), with a flat-topped window. */
static double add_score(const driveid_fsm_common *common, const fsm_sums *sums, int e, double variance, const double *theta, double *score) {
    const fsm_equation *q = &common->equation[e];
    const int p = common->regression.params, n = q->params + 1;
    const double freedom = sums->rows[e] - q->params - q->order, coarse = sums->coarse[e];
    const double unbias = sums->rows[e] / freedom / sums->weight2[e];
    double spread = 1, r0 = 0;
    for (int lag = 0; lag < FSM_LAGS; lag++) {
        const double window = lag <= FSM_LAGS / 2 ? 1 : 2.0 * (FSM_LAGS - lag) / FSM_LAGS;
        const double r = quadratic(q, sums->g[e][lag], theta) * unbias;
        if (lag == 0) r0 = r;
        else if (r0 > 0) spread += 2 * window * (r / r0) * (r / r0);
        const double share = window * r / (coarse * coarse * variance * variance);
        for (int i = 0; i < n - 1; i++)
            for (int j = 0; j < n - 1; j++) {
                const double g = lag ? sums->g[e][lag][i * n + j] + sums->g[e][lag][j * n + i] : sums->g[e][0][i * n + j];
                score[q->param[i] * p + q->param[j]] += share * g;
            }
    }
    return freedom / spread;
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
            for (int k = 0; k < p; k++) sum += left[i * p + k] * h[k * p + j];
            cov[i * p + j] = sum;
        }
}

/* How much of its equation each parameter's term carries. */
static void shares(const driveid_fsm_common *common, const fsm_sums *sums, fsm_solution *out) {
    for (int e = 0; e < common->regression.equations; e++) {
        const fsm_equation *q = &common->equation[e];
        const int n = q->params + 1;
        double whole = sums->s[e][n * n - 1];
        for (int i = 0; i < n - 1; i++) whole = fmax(whole, out->theta[q->param[i]] * out->theta[q->param[i]] * sums->s[e][i * n + i]);
        for (int i = 0; i < n - 1 && whole > 0; i++)
            out->share[q->param[i]] = fmax(out->share[q->param[i]], sqrt(sums->s[e][i * n + i] / whole));
    }
}

int fsm_solve(const driveid_fsm_common *common, const fsm_sums *sums, double small, fsm_solution *out) {
    const int p = common->regression.params, equations = common->regression.equations;
    double variance[DRIVEID_EQUATIONS_MAX] = {0}, h[DRIVEID_THETA_MAX * DRIVEID_THETA_MAX], score[DRIVEID_THETA_MAX * DRIVEID_THETA_MAX] = {0};
    memset(out, 0, sizeof *out);
    for (int e = 0; e < equations; e++) {
        const fsm_equation *q = &common->equation[e];
        const int n = q->params + 1;
        if (sums->rows[e] < q->params + q->order + ROWS_MIN) return 0;
        double trace = 0;
        for (int i = 0; i < n; i++) trace += sums->s[e][i * n + i];
        variance[e] = equations > 1 && trace > 0 ? trace / sums->weight[e] : 1;
    }
    least_squares(common, sums, variance, small, h, out);
    for (int e = 0; e < equations && equations > 1; e++) {
        const double r = quadratic(&common->equation[e], sums->s[e], out->theta) / sums->weight[e];
        variance[e] = fmax(r, 1e-20 * variance[e]);
    }
    if (equations > 1) least_squares(common, sums, variance, small, h, out);
    out->freedom = INFINITY;
    out->rows = INFINITY;
    for (int e = 0; e < equations; e++) {
        out->freedom = fmin(out->freedom, add_score(common, sums, e, variance[e], out->theta, score));
        out->rows = fmin(out->rows, sums->rows[e]);
    }
    sandwich(p, h, score, out->cov);
    shares(common, sums, out);
    out->residual_rms = sqrt(fmax(0, quadratic(&common->equation[0], sums->s[0], out->theta) / sums->weight[0]));
    for (int i = 0; i < p; i++) {
        if (out->pivot[i] > 0) out->score += 0.5 * log(fmax(out->cov[i * p + i], 1e-300));
        else out->score += 100;
    }
    return 1;
}

static double student(double freedom) {
    const double v = freedom > 3 ? freedom : 3;
    return 1.96 + (2.37 + (2.82 + 2.6 / v) / v) / v;
}

/* A parameter is weak where its interval says nothing: wider than half its value, and, for one that may be zero,
 * also wider than a tenth of what drives its equation. */
static int is_weak(const driveid_fsm_common *common, const fsm_solution *s, int i, double half) {
    if (!(s->pivot[i] > 0) || !(half > 0) || !isfinite(half)) return s->pivot[i] > 0 && half == 0 ? 0 : 1;
    if (half <= 0.5 * fabs(s->theta[i])) return 0;
    return !(common->regression.may_be_zero >> i & 1) || half * s->share[i] > 0.1;
}

void fsm_publish(driveid_fsm_common *common, int found, const fsm_solution *best, int64_t t_ns) {
    driveid_estimate *a = &common->answer;
    const int p = common->regression.params;
    common->chosen = (int8_t)found;
    if (found < 0) {
        common->status = DRIVEID_NOT_YET;
        return;
    }
    const double quantile = student(best->freedom);
    a->t_ns = t_ns;
    a->first_ns = common->first_ns;
    a->params = (uint32_t)p;
    a->samples = (uint32_t)fmin(best->rows, 4e9);
    a->valid_mask = a->weak_mask = 0;
    a->residual_rms = best->residual_rms;
    a->condition = best->condition;
    memcpy(a->cov, best->cov, sizeof a->cov);
    for (int i = 0; i < p; i++) {
        const double half = quantile * sqrt(fmax(0, best->cov[i * p + i]));
        a->theta[i] = best->theta[i];
        a->lo[i] = best->theta[i] - half;
        a->hi[i] = best->theta[i] + half;
        if (is_weak(common, best, i, half)) a->weak_mask |= 1u << i;
        else a->valid_mask |= 1u << i;
    }
    common->status = best->rank < p ? DRIVEID_RANK : a->weak_mask ? DRIVEID_WEAK_EXCITATION : DRIVEID_OK;
    if (common->status == DRIVEID_OK && a->first_trusted_ns == 0) a->first_trusted_ns = t_ns;
}
