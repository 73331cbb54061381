/* SPDX-License-Identifier: Apache-2.0 */
#include "q31.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/fixed.h"
#include "fsm_config.h"
#include "watch.h"

#define ORDER_BANK 3   /* a section's rounding comes back (bandwidth/omega)^order larger */
#define ORDER_WINDOW 5
#define SETTLED 20.0   /* times 1/bandwidth */
#define LIVE 30.0      /* times 1/bandwidth: then initial conditions are below the last bit */

static driveid_status refuse(char *reason, size_t size, const char *text) {
    if (reason && size) snprintf(reason, size, "%s", text);
    return DRIVEID_ERR_CONFIG;
}

static driveid_status check(const q31_state *self, char *reason, size_t reason_size) {
    const driveid_regression *r = &self->common.regression;
    const int order = self->common.sections - 2, bank = self->kind < Q31_WINDOW;
    for (unsigned c = 0; c < r->channels; c++)
        if (!(self->common.options.range[c] > 0) || !isfinite(self->common.options.range[c])) {
            if (reason && reason_size) snprintf(reason, reason_size, "q31 needs the declared range of channel %u (range, SI, above 0)", c);
            return DRIVEID_ERR_CONFIG;
        }
    if (bank && order > ORDER_BANK) return refuse(reason, reason_size, "q31 filters carry at most third derivatives: the rounding of a state comes back (bandwidth/omega)^order larger; take window, or f32");
    if (!bank && order > ORDER_WINDOW) return refuse(reason, reason_size, "q31 windows carry at most fifth derivatives: the weights cancel beyond; take f64");
    return DRIVEID_OK;
}

driveid_status q31_configure(q31_state *self, q31_kind kind, const driveid_regression *regression,
                             const driveid_estimator_options *options, char *reason, size_t reason_size) {
    memset(self, 0, sizeof *self);
    uint8_t level[DRIVEID_BANK_CHANNELS] = {0};
    driveid_status status = fsm_configure_common(&self->common, regression, options, level, reason, reason_size);
    if (status) return status;
    self->kind = (uint8_t)kind;
    if (kind == Q31_DISCRETE) self->common.options.model_error += kernel_bilinear_error(&self->common.options);
    status = check(self, reason, reason_size);
    if (status) return status;
    memcpy(self->level, level, sizeof self->level);
    for (unsigned c = 0; c < regression->channels; c++) self->count_per_SI[c] = FIXED_UNIT / options->range[c];
    status = q31_prepare(self, reason, reason_size);
    if (status) return status;
    const driveid_estimator_options *o = &self->common.options;
    const double row_s = fmax(kind >= Q31_WINDOW ? self->length * o->dt_s / KERNEL_ROWS : 0.5 / o->bandwidth_rad_s, o->dt_s);
    self->row_every = (uint32_t)fmax(1, floor(row_s / o->dt_s + 0.5));
    self->coarse = kind >= Q31_WINDOW ? KERNEL_ROWS / 2 : 3;
    const double memory = o->forgetting_s / (self->row_every * o->dt_s);
    self->forget_shift = (uint8_t)(isfinite(memory) ? fmin(fmax(floor(log2(memory) + 0.5), 4), 30) : 0);
    self->common.stages = 1;
    return q31_lay_out(self) ? DRIVEID_OK : refuse(reason, reason_size, "regression: too many terms for the fixed memory");
}

static driveid_status verdict(const driveid_svf_common *common) {
    return common->resting && common->status != DRIVEID_NOT_YET ? DRIVEID_FROZEN : common->status;
}

static void start(q31_state *self, int64_t t_ns, const int32_t *count, int fresh) {
    driveid_svf_common *common = &self->common;
    const double live_s = self->kind == Q31_RLS || (self->kind == Q31_FSM && !fresh) ? SETTLED / common->options.bandwidth_rad_s : 0;
    self->fresh = (uint8_t)(fresh && self->kind == Q31_FSM);
    q31_filter_start(self, count);
    q31_sums_skip(self);
    if (common->samples == 0) common->first_ns = t_ns;
    common->segment_ns = common->last_ns = t_ns;
    self->settled_ns = t_ns + (int64_t)(1e9 * live_s);
    self->row_left = self->row_every;
    common->running = 1;
    common->gap_told = 0;
    common->samples++;
    common->resting = common->forgetting_paused = 0;
    for (unsigned e = 0; e < common->regression.equations; e++) driveid_monitor_skip(&common->monitor[e]);
}

static driveid_status alarm(q31_state *self, int64_t t_ns, const int32_t *count) {
    driveid_svf_common *common = &self->common;
    q31_sums_clear(self);
    start(self, t_ns, count, 1);
    common->restart_ns = common->last_solve_ns = t_ns;
    common->answer.restarts++;
    common->answer.first_trusted_ns = 0;
    common->status = DRIVEID_NOT_YET;
    return DRIVEID_NOT_YET;
}

/* What all rows are watched for, in the row's own units; S as mean squares. */
static int watch(q31_state *self, unsigned e, const int32_t *row, double dt_s, double *least, double *most) {
    const fsm_equation *q = &self->common.equation[e];
    const q31_sums *sums = &self->sums[e];
    const int64_t *s = self->pool + sums->at;
    double phi[DRIVEID_THETA_MAX], square[DRIVEID_THETA_MAX];
    for (unsigned i = 0; i < q->params; i++) {
        phi[i] = row[i] * self->scale[e][i];
        square[i] = (double)s[i * (q->columns + 1u)] * 16384.0 * 65536.0 * self->scale[e][i] * self->scale[e][i];
    }
    watch_motion(&self->common, e, phi, square, (double)sums->weight, dt_s, least, most);
    if (self->fresh) return 0; /* the answers to the initial conditions are no part of the prediction */
    return watch_residual(&self->common, e, phi, row[q->columns - 1] * self->scale[e][q->columns - 1], dt_s);
}

static int rows(q31_state *self) {
    driveid_svf_common *common = &self->common;
    const double dt_s = self->row_every * common->options.dt_s;
    double least = 1, most = 0;
    int alarmed = 0;
    if (--self->row_left) return 0;
    self->row_left = self->row_every;
    if (common->last_ns < self->settled_ns) return 0;
    for (unsigned e = 0; e < common->regression.equations; e++) {
        int32_t row[FSM_COLUMNS_MAX];
        if (!q31_row(self, e, row)) continue;
        alarmed |= watch(self, e, row, dt_s, &least, &most);
        if (!common->resting) q31_sums_row(self, e, row);
    }
    if (self->fresh && 1e-9 * (double)(common->last_ns - common->segment_ns) * common->options.bandwidth_rad_s > LIVE) self->fresh = 0;
    if (most == 0) return alarmed;
    const int64_t full = (int64_t)(3 * 65536) << self->forget_shift;
    common->forgetting_paused = common->motion_mask && least < FSM_PAUSE;
    common->resting = common->motion_mask && (most < FSM_REST || (common->forgetting_paused && self->forget_shift && self->sums[0].weight > full));
    return alarmed;
}

/* Rounding makes noise of about 16 counts an order in a derivative's column (binomials, and the bits it is brought up by), 2 in a window's. What is below that the
 * sums cannot tell, so it is added to each variance. */
static void add_rounding(const q31_state *self, const fsm_sums *sums, fsm_solution *solution) {
    const driveid_regression *r = &self->common.regression;
    for (unsigned i = 0; i < r->terms; i++) {
        const driveid_term *t = &r->term[i];
        const fsm_equation *q = &self->common.equation[t->equation];
        if (t->param < 0) continue;
        const unsigned at = q->place[t->param], n = q->params + 1u;
        const double noise = self->scale[t->equation][at] * (double)(INT64_C(1) << ((self->kind >= Q31_WINDOW ? 1 : 4) * t->derivative));
        const double square = sums[t->equation].s[at * (n + 1)];
        const double part = square > 0 ? solution->theta[t->param] * noise / sqrt(square) : 0;
        double *variance = &solution->cov[(unsigned)t->param * (r->params + 1u)];
        *variance = fmax(*variance, 0) + part * part;
    }
}

static void answer(q31_state *self, int64_t t_ns) {
    fsm_solution solution;
    fsm_sums sums[DRIVEID_EQUATIONS_MAX];
    for (unsigned e = 0; e < self->common.regression.equations; e++) q31_gather(self, e, &sums[e]);
    const int found = fsm_solve(&self->common, sums, FSM_SMALL, &solution);
    if (found) add_rounding(self, sums, &solution);
    solution.windows = self->kind >= Q31_WINDOW;
    fsm_publish(&self->common, found, &solution, t_ns);
}

driveid_status q31_update_counts(q31_state *self, int64_t t_ns, const int32_t *count) {
    driveid_svf_common *common = &self->common;
    if (!common->running) {
        start(self, t_ns, count, 1);
        return DRIVEID_NOT_YET;
    }
    const int64_t dt_ns = t_ns - common->last_ns, nominal = (int64_t)(1e9 * common->options.dt_s), off = dt_ns - nominal;
    if (dt_ns <= 0) return dt_ns == 0 ? DRIVEID_DUPLICATE : DRIVEID_ERR_TIME;
    if (common->gap_told || off > nominal / 8 || off < -nominal / 8) {
        start(self, t_ns, count, 0);
        return DRIVEID_GAP;
    }
    q31_filter_step(self, count);
    common->last_ns = t_ns;
    common->samples++;
    if (rows(self)) return alarm(self, t_ns, count);
    if (t_ns - common->last_solve_ns < common->solve_ns) return verdict(common);
    if (common->answer.restarts && t_ns - common->restart_ns < (int64_t)(1e9 * FSM_HOLD_S)) return DRIVEID_NOT_YET;
    common->last_solve_ns = t_ns;
    if (!common->resting) answer(self, t_ns);
    return verdict(common);
}

/* Counts wrap where only derivatives are used, else they saturate. */
static int32_t count_of(q31_state *self, unsigned c, double value) {
    const double turns = 4294967296.0;
    double x = value * self->count_per_SI[c];
    if (self->level[c]) return x > 2147483647.0 || x < -2147483648.0 ? fixed_saturate(x > 0 ? INT64_MAX : INT64_MIN, &self->saturations) : (int32_t)lrint(x);
    x -= turns * floor(x / turns);
    return (int32_t)(uint32_t)(uint64_t)llrint(x);
}

driveid_status q31_update(q31_state *self, int64_t t_ns, const double *channel) {
    int32_t count[DRIVEID_CHANNELS_MAX];
    for (unsigned c = 0; c < self->common.regression.channels; c++)
        if (!isfinite(channel[c]) || fabs(channel[c] * self->count_per_SI[c]) > 9e15) return DRIVEID_ERR_VALUE;
    if (self->common.running && t_ns <= self->common.last_ns) return t_ns == self->common.last_ns ? DRIVEID_DUPLICATE : DRIVEID_ERR_TIME;
    for (unsigned c = 0; c < self->common.regression.channels; c++) count[c] = count_of(self, c, channel[c]);
    return q31_update_counts(self, t_ns, count);
}

void q31_restart(q31_state *self) {
    q31_sums_clear(self);
    self->common.running = 0;
    self->common.samples = 0;
    self->common.status = DRIVEID_NOT_YET;
    memset(&self->common.answer, 0, sizeof self->common.answer);
}
