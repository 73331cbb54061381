/* SPDX-License-Identifier: Apache-2.0 */
#include "fsm_config.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static driveid_status refuse(char *reason, size_t size, const char *text) {
    if (reason && size) snprintf(reason, size, "%s", text);
    return DRIVEID_ERR_CONFIG;
}

uint32_t fsm_equation_size(const fsm_equation *q) { return FSM_LANES * FSM_PAIRS(q->columns) + FSM_LAGS * FSM_PAIRS(q->params + 1u); }

uint32_t fsm_stage_size(const fsm_equation *q) { return q->columns * (1 + 2 * FSM_LAGS) + FSM_LAGS * FSM_PAIRS(q->columns); }

uint32_t fsm_pool_used(const driveid_svf_common *common) {
    uint32_t used = 0;
    for (unsigned e = 0; e < common->regression.equations; e++) used += fsm_equation_size(&common->equation[e]) + common->stages * fsm_stage_size(&common->equation[e]);
    return used;
}

static const char *fault_in(const driveid_regression *r) {
    if (r->equations < 1 || r->equations > DRIVEID_EQUATIONS_MAX) return "regression: equations must be 1..DRIVEID_EQUATIONS_MAX";
    if (r->channels < 1 || r->channels > DRIVEID_CHANNELS_MAX) return "regression: channels must be 1..DRIVEID_CHANNELS_MAX";
    if (r->params < 1 || r->params > DRIVEID_THETA_MAX) return "regression: params must be 1..DRIVEID_THETA_MAX";
    if (r->terms < 1 || r->terms > DRIVEID_TERMS_MAX) return "regression: terms must be 1..DRIVEID_TERMS_MAX";
    uint32_t seen = 0, known = 0;
    for (unsigned i = 0; i < r->terms; i++) {
        const driveid_term *t = &r->term[i];
        if (t->equation >= r->equations) return "regression: a term names an equation that is not there";
        if (t->channel >= r->channels) return "regression: a term names a channel that is not there";
        if (t->derivative > DRIVEID_ORDER_MAX) return "regression: a term's derivative is above DRIVEID_ORDER_MAX";
        if (t->param != DRIVEID_TERM_KNOWN && (t->param < 0 || t->param >= r->params)) return "regression: a term names a parameter that is not there";
        if (!isfinite(t->factor) || t->factor == 0) return "regression: a term's factor must be finite and not zero";
        if (t->param == DRIVEID_TERM_KNOWN) known = 1;
        else seen |= 1u << t->param;
    }
    for (unsigned c = 0; c < r->channels; c++)
        if (r->hold[c] > DRIVEID_HOLD_AVERAGE) return "regression: unknown hold";
    if (!known) return "regression: no known term: every parameter could be zero";
    if (seen != (1u << r->params) - 1) return "regression: a parameter has no term";
    return NULL;
}

static void split(driveid_svf_common *common, uint8_t *level) {
    const driveid_regression *r = &common->regression;
    unsigned highest = 0;
    for (unsigned c = 0; c < r->channels; c++) level[c] = 0;
    for (unsigned i = 0; i < r->terms; i++) {
        const driveid_term *t = &r->term[i];
        fsm_equation *equation = &common->equation[t->equation];
        if (t->derivative == 0) level[t->channel] = 1;
        if (t->derivative > equation->order) equation->order = t->derivative;
        if (t->derivative > highest) highest = t->derivative;
        if (t->param == DRIVEID_TERM_KNOWN) {
            equation->known = 1;
            continue;
        }
        if (t->derivative > 0) common->motion_mask |= UINT32_C(1) << t->param;
        unsigned j = 0;
        while (j < equation->params && equation->param[j] != t->param) j++;
        if (j == equation->params) equation->param[equation->params++] = t->param;
        equation->place[t->param] = (uint8_t)j;
    }
    for (unsigned i = 0; i < r->terms; i++) {
        const driveid_term *t = &r->term[i];
        fsm_equation *equation = &common->equation[t->equation];
        if (t->derivative == equation->order) equation->output = (int8_t)(t->param == DRIVEID_TERM_KNOWN ? -1 : equation->place[t->param]);
    }
    for (unsigned e = 0; e < r->equations; e++)
        common->equation[e].columns = (uint8_t)(common->equation[e].params + common->equation[e].order + 1);
    common->sections = (uint8_t)(highest + 2);
}

static void resolve(driveid_estimator_options *o, const driveid_regression *regression) {
    const double suggested_rad_s = regression->bandwidth_rad_s;
    if (o->bandwidth_rad_s == 0) o->bandwidth_rad_s = fmin(suggested_rad_s > 0 ? suggested_rad_s : 200, 0.25 / o->dt_s);
    if (o->model_error == 0) o->model_error = regression->model_error;
    if (o->model_error < 0) o->model_error = 0;
    if (o->forgetting_s == 0) o->forgetting_s = 10;
    if (o->gap_s == 0) o->gap_s = 5 * o->dt_s;
}

driveid_status fsm_configure_common(driveid_svf_common *common, const driveid_regression *regression,
                                    const driveid_estimator_options *options, uint8_t *level, char *reason, size_t reason_size) {
    const char *fault = fault_in(regression);
    if (fault) return refuse(reason, reason_size, fault);
    if (!(options->dt_s > 0) || !isfinite(options->dt_s)) return refuse(reason, reason_size, "dt_s must be the nominal sample time, above 0");
    if (options->bandwidth_rad_s < 0 || options->forgetting_s < 0 || options->gap_s < 0 || options->answer_s < 0 || isnan(options->alarm) || !isfinite(options->model_error))
        return refuse(reason, reason_size, "bandwidth_rad_s, forgetting_s, answer_s and gap_s must not be negative");
    common->regression = *regression;
    common->options = *options;
    resolve(&common->options, regression);
    const driveid_estimator_options *o = &common->options;
    if (o->bandwidth_rad_s * o->dt_s > 1) return refuse(reason, reason_size, "bandwidth_rad_s is above 1/dt_s: take a lower one or sample faster");
    split(common, level);
    common->row_ns = (int64_t)(0.5e9 / o->bandwidth_rad_s);
    if (common->row_ns < (int64_t)(1e9 * o->dt_s)) common->row_ns = (int64_t)(1e9 * o->dt_s);
    common->solve_ns = (int64_t)(o->answer_s > 0 ? 1e9 * o->answer_s : fmax(6.0 * (double)common->row_ns, 2e7));
    common->gap_ns = (int64_t)(1e9 * o->gap_s);
    memset(common->chosen, -1, sizeof common->chosen);
    common->status = DRIVEID_NOT_YET;
    for (unsigned e = 0; e < regression->equations; e++) driveid_monitor_init(&common->monitor[e], o->alarm);
    common->stages = FSM_STAGES;
    while (common->stages > 1 && fsm_pool_used(common) > FSM_POOL) common->stages--;
    if (fsm_pool_used(common) > FSM_POOL) return refuse(reason, reason_size, "regression: too many terms for the fixed memory");
    return DRIVEID_OK;
}

driveid_status fsm_answer_of(const driveid_svf_common *common, driveid_estimate *out) {
    const int have = common->status == DRIVEID_OK || common->status == DRIVEID_WEAK_EXCITATION || common->status == DRIVEID_RANK;
    if (have) *out = common->answer;
    return have && common->resting ? DRIVEID_FROZEN : common->status;
}
