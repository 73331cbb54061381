/* SPDX-License-Identifier: Apache-2.0 */
#include "learn.h"

#include <math.h>
#include <string.h>

#include "fsm_config.h"
#include "watch.h"

driveid_status learn_configure(learner *self, const learn_method *method, const driveid_regression *regression,
                               const driveid_estimator_options *options, char *reason, size_t reason_size) {
    uint8_t level[DRIVEID_BANK_CHANNELS] = {0};
    memset(self, 0, method->bytes);
    const driveid_status status = fsm_configure_common(&self->common, regression, options, level, reason, reason_size);
    if (status) return status;
    self->common.stages = 1;
    for (unsigned k = 0; k < LEARN_STAGES; k++) {
        self->row_ns[k] = self->common.row_ns;
        self->block_s[k] = 10 / self->common.options.bandwidth_rad_s;
    }
    return method->configure(self, level, reason, reason_size);
}

static driveid_status verdict(const driveid_svf_common *common) {
    return common->resting && common->status != DRIVEID_NOT_YET ? DRIVEID_FROZEN : common->status;
}

static void start(learner *self, const learn_method *method, int64_t t_ns, const double *channel) {
    driveid_svf_common *common = &self->common;
    method->start(self, channel);
    learn_sums_skip(self);
    if (common->samples == 0) common->first_ns = t_ns;
    common->segment_ns = common->last_ns = t_ns;
    for (unsigned k = 0; k < LEARN_STAGES; k++) self->last_row_ns[k] = t_ns;
    common->running = 1;
    common->gap_told = 0;
    common->samples++;
    common->resting = common->forgetting_paused = 0;
    for (unsigned e = 0; e < common->regression.equations; e++) driveid_monitor_skip(&common->monitor[e]);
}

static void clear(learner *self, const learn_method *method) {
    learn_sums_clear(self);
    if (method->clear) method->clear(self);
    memset(self->known, 0, sizeof self->known);
}

static driveid_status gap(learner *self, const learn_method *method, int64_t t_ns, const double *channel) {
    const double silence_s = 1e-9 * (double)(t_ns - self->common.last_ns);
    learn_sums_forget(self, exp(-silence_s / self->common.options.forgetting_s));
    start(self, method, t_ns, channel);
    return DRIVEID_GAP;
}

/* The model no longer explains the drive: what was learnt belongs to the drive as it was. The answer is held for a while. */
static driveid_status alarm(learner *self, const learn_method *method, int64_t t_ns, const double *channel) {
    driveid_svf_common *common = &self->common;
    clear(self, method);
    start(self, method, t_ns, channel);
    common->restart_ns = common->last_solve_ns = t_ns;
    common->answer.restarts++;
    common->answer.first_trusted_ns = 0;
    common->status = DRIVEID_NOT_YET;
    return DRIVEID_NOT_YET;
}

static void stage_rows(learner *self, const learn_method *method, unsigned k, double dt_s, double *least, double *most, int *alarmed) {
    driveid_svf_common *common = &self->common;
    const double decay = common->forgetting_paused ? 1 : exp(-dt_s / common->options.forgetting_s);
    for (unsigned e = 0; e < common->regression.equations; e++) {
        double x[LEARN_WIDE];
        if (!method->row(self, e, k, x)) continue;
        if (k == 0) {
            *alarmed |= watch_residual(common, e, x, x[common->equation[e].params], dt_s);
            double square[LEARN_WIDE];
            for (unsigned j = 0; j < LEARN_WIDE; j++) square[j] = self->sums[k][e].s[j * LEARN_WIDE + j];
            watch_motion(common, e, x, square, self->sums[k][e].weight, dt_s, least, most);
        }
        if (common->resting) continue;
        learn_sums_row(self, e, k, x, dt_s, decay);
        if (k == 0 && method->learn) method->learn(self, e, x, decay, dt_s);
    }
}

/* 1: residual alarm */
static int rows(learner *self, const learn_method *method, int64_t dt_ns) {
    driveid_svf_common *common = &self->common;
    double least = 1, most = 0;
    int alarmed = 0, watched = 0;
    for (unsigned k = 0; k < common->stages; k++) {
        const int64_t row_dt = common->last_ns - self->last_row_ns[k];
        if (row_dt + dt_ns / 2 < self->row_ns[k]) continue;
        self->last_row_ns[k] = common->last_ns;
        watched |= k == 0;
        stage_rows(self, method, k, 1e-9 * (double)row_dt, &least, &most, &alarmed);
    }
    if (!watched || most == 0) return alarmed; /* no row of the watched stage */
    const double full = 3 * common->options.forgetting_s / (1e-9 * (double)self->row_ns[0]);
    common->forgetting_paused = common->motion_mask && least < FSM_PAUSE;
    common->resting = common->motion_mask && (most < FSM_REST || (common->forgetting_paused && self->sums[0][0].weight > full));
    return alarmed;
}

static void answer(learner *self, const learn_method *method, int64_t t_ns) {
    fsm_solution solution;
    fsm_publish(&self->common, learn_solve(self, method, &solution), &solution, t_ns);
}

driveid_status learn_update(learner *self, const learn_method *method, int64_t t_ns, const double *channel) {
    driveid_svf_common *common = &self->common;
    for (unsigned c = 0; c < common->regression.channels; c++)
        if (!isfinite(channel[c])) return DRIVEID_ERR_VALUE;
    if (!common->running) {
        start(self, method, t_ns, channel);
        return DRIVEID_NOT_YET;
    }
    const int64_t dt_ns = t_ns - common->last_ns;
    if (dt_ns <= 0) return dt_ns == 0 ? DRIVEID_DUPLICATE : DRIVEID_ERR_TIME;
    if (dt_ns > common->gap_ns || common->gap_told) return gap(self, method, t_ns, channel);
    method->step(self, dt_ns, channel);
    common->last_ns = t_ns;
    common->samples++;
    if (rows(self, method, dt_ns)) return alarm(self, method, t_ns, channel);
    if (t_ns - common->last_solve_ns < common->solve_ns) return verdict(common);
    if (common->answer.restarts && t_ns - common->restart_ns < (int64_t)(1e9 * FSM_HOLD_S)) return DRIVEID_NOT_YET;
    common->last_solve_ns = t_ns;
    if (!common->resting) answer(self, method, t_ns);
    return verdict(common);
}

void learn_restart(learner *self, const learn_method *method) {
    driveid_svf_common *common = &self->common;
    clear(self, method);
    common->running = 0;
    common->samples = 0;
    common->status = DRIVEID_NOT_YET;
    memset(&common->answer, 0, sizeof common->answer);
}
