/* SPDX-License-Identifier: Apache-2.0 */
#include "shifting.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/solve.h"

int shifting_inputs(const driveid_fsm_config *c) { return c->zeros == DRIVEID_FSM_AUTONOMOUS ? 0 : c->zeros + 1; }

int shifting_unknowns(const driveid_fsm_config *c) {
    int n = shifting_inputs(c);
    for (int i = 0; i < c->order; i++) n += !(c->fixed_mask >> i & 1);
    return n;
}

driveid_status shifting_check(const driveid_fsm_config *c, char *reason, size_t reason_size) {
    const char *fault = NULL;
    char text[160];
    if (c->order < 1 || c->order > DRIVEID_FSM_ORDER_MAX) fault = "order must be 1..6";
    else if (c->zeros != DRIVEID_FSM_AUTONOMOUS && c->zeros > c->order) fault = "zeros must not exceed order";
    else if (c->poles <= c->order || c->poles > DRIVEID_FSM_POLES_MAX) fault = "poles must be order + 1 .. 8";
    else if (!(c->q_per_s > 0) || !isfinite(c->q_per_s)) fault = "q_per_s must be above 0";
    else if (shifting_unknowns(c) < 1) fault = "nothing is unknown";
    else if (shifting_unknowns(c) > DRIVEID_SOLVE_MAX) fault = "more unknowns than this build solves for (DRIVEID_SOLVE_MAX)";
    else if (c->hold_y > DRIVEID_HOLD_AVERAGE || c->hold_u > DRIVEID_HOLD_AVERAGE) fault = "unknown hold";
    else {
        const double highest = (c->order + shifting_unknowns(c) - 1) * c->q_per_s;
        for (int k = 0; k < c->poles; k++)
            if (!(c->pole_rad_s[k] > highest) || !isfinite(c->pole_rad_s[k])) {
                snprintf(text, sizeof text, "pole %d is not above %g rad/s, the highest shift: take higher poles or a smaller q_per_s", k, highest);
                fault = text;
            }
    }
    if (!fault) return DRIVEID_OK;
    if (reason && reason_size) snprintf(reason, reason_size, "%s", fault);
    return DRIVEID_ERR_CONFIG;
}

double shifting_binomial(int n, int k) {
    double b = 1;
    for (int i = 0; i < k; i++) b = b * (n - i) / (i + 1);
    return b;
}

double shifting_gamma(int l, int k, int i, double q) {
    double sum = 0;
    for (int r = 0; r <= l; r++) sum += (r & 1 ? -1 : 1) * shifting_binomial(l, r) * (k == 0 ? 1 : pow(l - r, k));
    return pow(q, k) * shifting_binomial(i, k) * sum;
}

enum { SIZE = DRIVEID_FSM_POLES_MAX + 2 };

static void multiply(double a[SIZE][SIZE], double b[SIZE][SIZE], double out[SIZE][SIZE], int n) {
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            double sum = 0;
            for (int k = 0; k < n; k++) sum += a[i][k] * b[k][j];
            out[i][j] = sum;
        }
}

/* Matrix exponential by Taylor series after halving, of the cascade with its input and the input's slope as two states more. */
void shifting_transition(const double *a, int n, double h, double out[DRIVEID_FSM_POLES_MAX][DRIVEID_FSM_POLES_MAX + 2]) {
    double m[SIZE][SIZE] = {{0}}, term[SIZE][SIZE] = {{0}}, sum[SIZE][SIZE] = {{0}}, next[SIZE][SIZE];
    const int size = n + 2;
    double norm = 0;
    int halvings = 0;
    for (int j = 0; j < n; j++) norm = fmax(norm, 2 * a[j] * h + 1);
    for (; norm > 0.5; norm /= 2) halvings++;
    const double scale = ldexp(1, -halvings);
    for (int j = 0; j < n; j++) {
        m[j][j] = -a[j] * h * scale;
        m[j][j ? j - 1 : n] = a[j] * h * scale;
    }
    m[n][n + 1] = scale;
    for (int i = 0; i < size; i++) term[i][i] = sum[i][i] = 1;
    for (int k = 1; k < 18; k++) {
        multiply(term, m, next, size);
        for (int i = 0; i < size; i++)
            for (int j = 0; j < size; j++) sum[i][j] += term[i][j] = next[i][j] / k;
    }
    for (; halvings > 0; halvings--) {
        multiply(sum, sum, next, size);
        memcpy(sum, next, sizeof sum);
    }
    for (int j = 0; j < n; j++)
        for (int i = 0; i < size; i++) out[j][i] = sum[j][i];
}

static void solve_c(const driveid_fsm_config *c, const double *s_c, double small, driveid_fsm_estimate *out) {
    const int n = c->order, inputs = shifting_inputs(c), lead = n + 1 + inputs, size = lead + n;
    double a[DRIVEID_FSM_ORDER_MAX * DRIVEID_FSM_ORDER_MAX] = {0}, inverse[DRIVEID_FSM_ORDER_MAX * DRIVEID_FSM_ORDER_MAX], pivot[DRIVEID_FSM_ORDER_MAX];
    double right[DRIVEID_FSM_ORDER_MAX];
    for (int i = 0; i < n; i++) {
        right[i] = 0;
        for (int j = 0; j < lead; j++) {
            const double factor = j == n ? 1 : j < n ? out->a[j] : -out->b[j - n - 1];
            right[i] += factor * s_c[(lead + i) * size + j];
        }
        for (int j = 0; j < n; j++) a[i * n + j] = s_c[(lead + i) * size + lead + j];
    }
    driveid_solve_inverse(a, n, small, inverse, pivot);
    for (int i = 0; i < n; i++) {
        out->c[i] = 0;
        for (int j = 0; j < n; j++) out->c[i] += inverse[i * n + j] * right[j];
    }
}

driveid_status shifting_solve(const driveid_fsm_config *c, const double *s, const double *s_c, double small, driveid_fsm_estimate *out) {
    const int unknowns = shifting_unknowns(c), size = unknowns + 1;
    double a[DRIVEID_FSM_COLUMNS_MAX * DRIVEID_FSM_COLUMNS_MAX] = {0}, inverse[DRIVEID_FSM_COLUMNS_MAX * DRIVEID_FSM_COLUMNS_MAX];
    double pivot[DRIVEID_FSM_COLUMNS_MAX], theta[DRIVEID_FSM_COLUMNS_MAX];
    for (int i = 0; i < unknowns; i++)
        for (int j = 0; j < unknowns; j++) a[i * unknowns + j] = s[i * size + j];
    if (driveid_solve_inverse(a, unknowns, small, inverse, pivot) < unknowns) return DRIVEID_RANK;
    memset(out->a, 0, sizeof out->a);
    memset(out->b, 0, sizeof out->b);
    out->condition = 1;
    for (int i = 0; i < unknowns; i++) {
        theta[i] = 0;
        for (int j = 0; j < unknowns; j++) theta[i] += inverse[i * unknowns + j] * s[j * size + unknowns];
        out->condition = fmax(out->condition, 1 / pivot[i]);
    }
    int at = 0;
    for (int i = 0; i < c->order; i++)
        if (!(c->fixed_mask >> i & 1)) out->a[i] = theta[at++];
    for (int j = 0; j < shifting_inputs(c); j++) out->b[j] = theta[at++];
    solve_c(c, s_c, small, out);
    return DRIVEID_OK;
}
