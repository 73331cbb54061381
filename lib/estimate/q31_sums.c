/* SPDX-License-Identifier: Apache-2.0 */
#include "q31.h"

#include <math.h>
#include <string.h>

#include "base/fixed.h"

#define PRODUCT 14 /* bits taken off a product of two Q30 values: sums are Q46 */
#define ROW (INT64_C(1) << 16)
#define FULL (INT64_C(1) << 61)

typedef struct block {
    int64_t *s, *g, *open;
    int32_t *ring;
} block;

static block block_of(q31_state *self, unsigned e) {
    const unsigned m = self->common.equation[e].columns, n = self->common.equation[e].params + 1u;
    block b;
    b.s = self->pool + self->sums[e].at;
    b.g = b.s + m * m;
    b.open = b.g + FSM_LAGS * n * n;
    b.ring = (int32_t *)(b.open + n);
    return b;
}

int q31_lay_out(q31_state *self) {
    uint32_t at = 0, lags = 0;
    for (unsigned e = 0; e < self->common.regression.equations; e++) {
        const unsigned m = self->common.equation[e].columns, n = self->common.equation[e].params + 1u;
        self->sums[e].at = at;
        self->sums[e].lags_at = lags;
        lags += FSM_LAGS * FSM_PAIRS(n);
        at += m * m + FSM_LAGS * n * n + n + (FSM_LAGS * n + 1) / 2;
    }
    return at <= DRIVEID_Q31_POOL && lags <= Q31_LAGS;
}

static int64_t faded(int64_t x, unsigned shift, int64_t times) { return x - fixed_round(x, shift) * times; }

static void close_coarse(q31_state *self, unsigned e, const block *b) {
    q31_sums *sums = &self->sums[e];
    const unsigned n = self->common.equation[e].params + 1u;
    int32_t *now = b->ring + sums->ring_next * n;
    for (unsigned i = 0; i < n; i++) {
        now[i] = (int32_t)(b->open[i] / self->coarse);
        b->open[i] = 0;
    }
    for (unsigned lag = 0; lag < FSM_LAGS; lag++) {
        int64_t *g = b->g + lag * n * n;
        const int32_t *then = b->ring + (sums->ring_next + FSM_LAGS - lag) % FSM_LAGS * n;
        for (unsigned i = 0; i < n; i++)
            for (unsigned j = 0; j < n; j++, g++) {
                if (self->forget_shift && !self->common.forgetting_paused) *g = faded(*g, self->forget_shift, 2 * self->coarse);
                if (lag <= sums->ring_fill) *g += fixed_round((int64_t)now[i] * then[j], PRODUCT);
            }
    }
    if (self->forget_shift && !self->common.forgetting_paused) {
        sums->weight2 = faded(sums->weight2, self->forget_shift, 2 * self->coarse);
        sums->coarse_rows = faded(sums->coarse_rows, self->forget_shift, self->coarse);
    }
    sums->weight2 += ROW;
    sums->coarse_rows += ROW;
    sums->ring_next = (uint8_t)((sums->ring_next + 1) % FSM_LAGS);
    if (sums->ring_fill < FSM_LAGS - 1) sums->ring_fill++;
    sums->count = 0;
}

static void halve(q31_state *self, unsigned e, const block *b) {
    q31_sums *sums = &self->sums[e];
    for (int64_t *x = b->s; x < b->open; x++) *x = fixed_round(*x, 1);
    sums->weight /= 2;
    sums->weight2 /= 2;
    sums->coarse_rows /= 2;
}

void q31_sums_row(q31_state *self, unsigned e, const int32_t *row) {
    const fsm_equation *q = &self->common.equation[e];
    q31_sums *sums = &self->sums[e];
    const block b = block_of(self, e);
    const unsigned m = q->columns, fade = self->common.forgetting_paused ? 0 : self->forget_shift;
    int full = 0;
    for (unsigned i = 0; i < m; i++)
        for (unsigned j = 0; j <= i; j++) {
            int64_t *s = b.s + i * m + j;
            if (fade) *s = faded(*s, fade, 1);
            *s += fixed_round((int64_t)row[i] * row[j], PRODUCT);
            full |= *s > FULL;
        }
    if (fade) sums->weight = faded(sums->weight, fade, 1);
    sums->weight += ROW;
    if (full) halve(self, e, &b);
    if (self->fresh) return; /* lagged sums are kept without the answers to the initial conditions */
    for (unsigned i = 0; i < q->params; i++) b.open[i] += row[i];
    b.open[q->params] += row[m - 1];
    if (++sums->count >= self->coarse) close_coarse(self, e, &b);
}

void q31_sums_skip(q31_state *self) {
    for (unsigned e = 0; e < self->common.regression.equations; e++) {
        const unsigned n = self->common.equation[e].params + 1u;
        memset(block_of(self, e).open, 0, n * sizeof(int64_t));
        self->sums[e].count = 0;
        self->sums[e].ring_next = self->sums[e].ring_fill = 0;
    }
}

void q31_sums_clear(q31_state *self) {
    memset(self->pool, 0, sizeof self->pool);
    for (unsigned e = 0; e < DRIVEID_EQUATIONS_MAX; e++) {
        const uint32_t at = self->sums[e].at, lags_at = self->sums[e].lags_at;
        memset(&self->sums[e], 0, sizeof self->sums[e]);
        self->sums[e].at = at;
        self->sums[e].lags_at = lags_at;
    }
}

/* Into SI; the instant's initial conditions eliminated. */
void q31_gather(q31_state *self, unsigned e, fsm_sums *out) {
    const fsm_equation *q = &self->common.equation[e];
    const q31_sums *sums = &self->sums[e];
    const block b = block_of(self, e);
    const unsigned m = q->columns, n = q->params + 1u;
    const double unit = (double)(INT64_C(1) << PRODUCT), rows = (double)ROW;
    double full[FSM_COLUMNS_MAX * FSM_COLUMNS_MAX], solved[DRIVEID_ORDER_MAX * FSM_COLUMNS_MAX];
    for (unsigned i = 0; i < m; i++)
        for (unsigned j = 0; j <= i; j++) full[i * m + j] = full[j * m + i] = unit * (double)b.s[i * m + j] * self->scale[e][i] * self->scale[e][j];
    fsm_solve_initial(q, full, FSM_SMALL, solved);
    fsm_eliminate_initial(q, solved, full);
    fsm_pack(q, full, out->s);
    double *g = self->lags + self->sums[e].lags_at;
    out->g = g;
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j <= i; j++, g += FSM_LAGS) {
            const double si = self->scale[e][i < n - 1 ? i : m - 1], sj = self->scale[e][j < n - 1 ? j : m - 1];
            const int64_t *one = b.g + i * n + j, *other = b.g + j * n + i;
            for (unsigned lag = 0; lag < FSM_LAGS; lag++) g[lag] = unit * self->coarse * self->coarse * (double)(one[lag * n * n] + other[lag * n * n]) * si * sj;
        }
    out->weight = (double)sums->weight / rows;
    out->weight2 = (double)sums->weight2 / rows;
    out->rows = out->weight2 > 0 ? (double)sums->coarse_rows / rows * ((double)sums->coarse_rows / rows) / out->weight2 : 0;
    out->coarse = self->coarse;
    out->spent = q->order;
    out->pole_rad_s = 0;
}
