/* SPDX-License-Identifier: Apache-2.0 */
#include <driveid/watch.h>

#include <math.h>
#include <string.h>

#include "model_watch_state.h"

#define TOLERANCE 0.01       /* of the equation's largest term, rms: what the reference may be off by */
#define STILL 0.0025         /* of the usual square of speed, and of acceleration */
#define ASLEEP_S 2.0         /* of standstill, and nothing is computed any more */
#define ROW 0.5              /* times 1/pole: between rows; the low-pass leaves nothing that changes faster */
#define SETTLE 16.0          /* times 1/pole: until the start of the filters is forgotten */
#define LEARN_S 5.0          /* of motion before the first reference, and beside it before the first mismatch */
#define FRESH_S 0.5          /* of motion in the sums before they are looked at */
#define NAME_S 0.5           /* of motion with the same name that earlier rows gave: a burst is no effect */
#define PRODUCT_NAME_S 2.0   /* where the column has the torque as a factor: for a while it looks like any error of the torque */
#define UNKNOWN_S 4.0        /* of motion beyond the limits, in a row, in which no effect explains it: a mismatch all the same */
#define UNDECIDED_S 8.0      /* or whose name is still not settled */
#define CALM_S 3.0           /* of motion below them in a row before it is none */
#define SHARP 0.003          /* of the equation's largest term, rms: uncertainty of an answer that refines the reference */
#define SHARP_FIRST 0.006    /* and of one that becomes it */
#define ESTIMATES_MAX 100    /* answers in the mean that is a learnt reference */
#define YOUNG_S 4.0          /* of motion in which a reference that was learnt may still turn out to be wrong */
#define REFRESH_S 5.0        /* of quiet motion after which a learnt reference follows the estimator */
#define FOLLOW_S 8.0         /* of motion with the mismatch before other parameters may take the reference's place */
#define EXPLAINS 0.12        /* of r'r: less is no likely effect */

size_t driveid_watch_size(void) { return sizeof(driveid_watch); }

const driveid_watch_report *driveid_watch_answer(const driveid_watch *watch) { return &watch->report; }

const char *driveid_watch_regime_name(driveid_watch_regime regime) {
    static const char *const names[] = {"standstill", "slow", "accelerating", "braking", "at speed"};
    return (unsigned)regime < DRIVEID_WATCH_REGIMES ? names[regime] : "";
}

/* ---- set-up ---- */

static const driveid_param *value_of(const driveid_model *model, const char *name) {
    const driveid_param *p = driveid_model_param(model, name);
    for (uint32_t e = 0; !p && e < model->effects; e++)
        for (uint32_t i = 0; i < model->effect[e].params; i++)
            if (strcmp(model->effect[e].param[i].name, name) == 0) p = &model->effect[e].param[i];
    return p && p->state != DRIVEID_PARAM_UNSET ? p : NULL;
}

/* Base columns of the mechanical equation, and the reference where the model has all their values. */
static driveid_status lay_out(driveid_watch *w) {
    const driveid_regression *r = &w->online.regression;
    w->has_reference = 1;
    memset(w->place, WATCH_BASE, sizeof w->place);
    for (unsigned i = 0; i < r->terms; i++) {
        const driveid_term *t = &r->term[i];
        if (t->equation != w->online.mechanical || t->param == DRIVEID_TERM_KNOWN || w->place[t->param] < WATCH_BASE) continue;
        if (w->params + 1 >= WATCH_BASE) return DRIVEID_ERR_CAPACITY;
        const driveid_param *p = value_of(&w->online.model, w->online.physical_name[t->param]);
        if (p) {
            w->reference[w->params] = p->value;
            w->sigma[w->params] = (p->hi - p->lo) / (2 * 1.96);
        }
        if (!p) w->has_reference = 0;
        w->place[t->param] = w->params++;
    }
    return DRIVEID_OK;
}

static void find_motion(driveid_watch *w, unsigned *order) {
    const driveid_regression *r = &w->online.regression;
    for (unsigned i = 0; i < r->terms; i++) {
        const driveid_term *t = &r->term[i];
        if (t->equation != w->online.mechanical || t->derivative < *order) continue;
        *order = t->derivative;
        w->motion_channel = t->channel;
    }
    w->motion_derivative = (uint8_t)(*order - 1);
    w->online.uses_speed = 1;
    w->online.motion = w->online.filler[w->motion_channel].a;
    w->online.delayed = w->motion_derivative > 0 ? DRIVEID_ONLINE_DELAY : 0;
}

static void make_filters(driveid_watch *w, unsigned order, double pole_rad_s) {
    uint8_t level[DRIVEID_BANK_CHANNELS];
    const driveid_regression *r = &w->online.regression;
    memset(level, 1, sizeof level);
    level[w->motion_channel] = 0;
    driveid_bank_init_f64(&w->base, r->channels, (uint8_t)(order + 2), pole_rad_s, r->hold, level);
    watch_filter_init(&w->column, w->columns, order + 2, pole_rad_s);
}

driveid_status driveid_watch_init(driveid_watch *w, const driveid_online *online, double dt_s) {
    if (!w || !online || !(dt_s > 0)) return DRIVEID_ERR_ARGUMENT;
    memset(w, 0, sizeof *w);
    w->name = w->said = -1;
    w->online = *online;
    if (online->mechanical < 0) return DRIVEID_ERR_CONFIG;
    const double suggested = online->regression.bandwidth_rad_s, pole = fmin(suggested > 0 ? suggested : 200, 0.25 / dt_s);
    unsigned order = 1;
    const driveid_status status = lay_out(w);
    if (status) return status;
    w->from_file = w->has_reference;
    find_motion(w, &order);
    if (order + 2 > WATCH_SECTIONS) return DRIVEID_ERR_CAPACITY;
    watch_list(w);
    make_filters(w, order, pole);
    w->dt_s = dt_s;
    watch_skew_init(w);
    w->row_ns = (int64_t)(ROW * 1e9 / pole);
    w->settle_ns = (int64_t)(SETTLE * 1e9 / pole);
    driveid_monitor_init(&w->monitor, 0);
    return DRIVEID_OK;
}

/* ---- rows ---- */

static void start(driveid_watch *w, int64_t t_ns, const double *channel) {
    driveid_bank_start_f64(&w->base, channel, NULL);
    watch_filter_start(&w->column);
    driveid_monitor_skip(&w->monitor);
    w->start_ns = w->last_row_ns = t_ns;
    w->running = 1;
}

static void base_row(const driveid_watch *w, double *row) {
    const driveid_regression *r = &w->online.regression;
    for (unsigned j = 0; j <= w->params; j++) row[j] = 0;
    for (unsigned i = 0; i < r->terms; i++) {
        const driveid_term *t = &r->term[i];
        if (t->equation != w->online.mechanical) continue;
        const double value = t->factor * driveid_bank_value_f64(&w->base, t->channel, t->derivative);
        if (t->param == DRIVEID_TERM_KNOWN) row[w->params] -= value;
        else row[w->place[t->param]] += value;
    }
}

static void candidate_row(const driveid_watch *w, double *z) {
    watch_filter_read(&w->column, z);
    for (unsigned i = 0; i < w->taps; i++) z[w->tap[i].column] = w->tap[i].factor * driveid_bank_value_f64(&w->base, w->tap[i].channel, w->tap[i].derivative);
}

static void add_product(double *restrict sum, const double *restrict z, const double *restrict by, double times, double decay, unsigned columns) {
    for (unsigned i = 0; i < columns; i++) sum[i] = decay * sum[i] + z[i] * (by ? by[i] : times);
}

static void add_row(driveid_watch *w, const double *row, const double *z, double decay) {
    for (unsigned i = 0; i <= w->params; i++)
        for (unsigned j = 0; j <= w->params; j++) w->bb[i][j] = decay * w->bb[i][j] + row[i] * row[j];
    for (unsigned j = 0; j <= w->params; j++) add_product(w->zb[j], z, NULL, row[j], decay, w->columns);
    for (unsigned d = 0; d < WATCH_EACH; d++) add_product(w->zz[d], z, z + d, 0, decay, w->columns);
    w->weight = decay * w->weight + 1;
}

/* Rises at once, falls in a day: a rest does not turn noise into motion. */
static void follow_level(double *level, double square, double dt_s) {
    const double d = dt_s / (square > *level ? 0.5 : 1e5);
    *level += (*level == 0 ? 1 : fmin(d, 1)) * (square - *level);
}

static driveid_watch_regime regime_of(const driveid_watch *w, double speed, double accel) {
    const double v2 = speed * speed, a2 = accel * accel;
    if (v2 < STILL * w->speed2 && a2 < STILL * w->accel2) return DRIVEID_WATCH_STANDSTILL;
    if (a2 > 0.05 * w->accel2) return speed * accel >= 0 ? DRIVEID_WATCH_ACCELERATING : DRIVEID_WATCH_BRAKING;
    return v2 < 0.1 * w->speed2 ? DRIVEID_WATCH_SLOW : DRIVEID_WATCH_STEADY;
}

static double residual_of(const driveid_watch *w, const double *row, double *drive2) {
    double r = row[w->params];
    *drive2 = r * r;
    for (unsigned i = 0; i < w->params; i++) {
        const double part = row[i] * w->reference[i];
        r -= part;
        *drive2 = fmax(*drive2, part * part);
    }
    return r;
}

static void follow_regimes(driveid_watch *w, driveid_watch_regime now, double r2, double decay, double dt_s) {
    for (int k = 0; k < DRIVEID_WATCH_REGIMES; k++) {
        w->regime_r2[k] *= decay;
        w->regime_weight[k] *= decay;
    }
    w->regime_r2[now] += r2;
    w->regime_weight[now] += 1;
    if (!w->over_s) w->regime_usual[now] += (w->regime_usual[now] == 0 ? 1 : dt_s / 20) * (r2 - w->regime_usual[now]);
}

/* The regime that holds most of what is above the usual. */
static driveid_watch_regime worst_regime(const driveid_watch *w) {
    int worst = 0;
    double most = -INFINITY;
    for (int k = 0; k < DRIVEID_WATCH_REGIMES; k++) {
        const double excess = w->regime_r2[k] - w->regime_weight[k] * w->regime_usual[k];
        if (w->regime_weight[k] > 0 && excess > most) most = excess, worst = k;
    }
    return (driveid_watch_regime)worst;
}

/* ---- verdict ---- */

static void clear_sums(driveid_watch *w) {
    w->weight = 0;
    memset(w->bb, 0, sizeof w->bb);
    memset(w->zb, 0, sizeof w->zb);
    memset(w->zz, 0, sizeof w->zz);
    memset(w->regime_r2, 0, sizeof w->regime_r2);
    memset(w->regime_weight, 0, sizeof w->regime_weight);
}

/* Effects beside the one that is said. */
static void report_ties(driveid_watch *w, const watch_finding *f) {
    driveid_watch_report *r = &w->report;
    const unsigned said = w->candidate[w->said].effect, best = w->candidate[f->best].effect;
    int place = said == best ? -1 : (int)f->ties - 1; /* of the best one: where the said one stands, or the last of those that found room */
    for (unsigned i = 0; i < f->ties; i++)
        if (f->tie[i] == said) place = (int)i;
    r->ties = f->ties;
    for (unsigned i = 0; i < f->ties; i++) r->tie[i] = driveid_effect_at((int)i == place ? best : f->tie[i])->name;
}

/* A name that was said stays while nothing is told from it. */
static void report(driveid_watch *w, const watch_finding *f, int named) {
    driveid_watch_report *r = &w->report;
    if (!r->mismatch) r->since_ns = w->first_over_ns;
    if (!r->mismatch) watch_skew_clear(w); /* the drive is another one now */
    const int stays = r->mismatch && named && f->said >= 0;
    w->said = stays ? f->said : named ? f->best : -1;
    r->mismatch = 1;
    r->effect = w->said >= 0 ? driveid_effect_at(w->candidate[w->said].effect)->name : "unknown";
    r->order = w->said >= 0 ? w->candidate[w->said].order : 0;
    r->share = w->said < 0 ? 0 : stays ? f->said_share : f->share;
    r->ties = 0;
    if (w->said >= 0) report_ties(w, f);
    r->regime = worst_regime(w);
}

static void no_mismatch(driveid_watch *w) {
    w->over_s = w->unnamed_s = w->calm_s = w->name_s = 0;
    w->name = w->said = -1;
    w->named_before = 0;
    w->report.mismatch = 0;
    w->report.effect = NULL;
    w->report.share = w->report.order = 0;
    w->report.ties = 0;
}

/* What a candidate takes is more than a part of the residual, and more than nothing beside the drive. */
static int explained(const watch_finding *f) { return f->best >= 0 && f->share > EXPLAINS && f->size2 > TOLERANCE * TOLERANCE * f->drive2; }

/* A name is said once two stretches of motion, one after the other, gave the same. */
static int settled(driveid_watch *w, int name, double motion_s) {
    if (name < 0) {
        w->name_s = 0;
        return 0;
    }
    const int same = watch_alike(w, name, w->name);
    w->name_s = same ? w->name_s + motion_s : 0;
    if (!same) w->named_before = 0;
    w->name = name;
    if (w->name_s < (w->candidate[name].product ? PRODUCT_NAME_S : NAME_S)) return 0;
    if (w->named_before || w->report.mismatch) return 1;
    w->named_before = 1;
    w->name_s = w->motion_s = 0;
    clear_sums(w);
    return 0;
}

static void look(driveid_watch *w, double motion_s) {
    const watch_finding f = watch_find(w, w->reference);
    const double usual = w->monitor.noise + w->monitor.ratio * f.drive2;
    const int named = explained(&f), own = named && w->candidate[f.best].own;
    if (own && !w->from_file && w->young_s < YOUNG_S) {
        w->has_reference = 0; /* it was taken before the estimator had settled */
        return;
    }
    const int excess = w->monitor.blocks > 100 && f.r2 > 9 * usual + 9 * TOLERANCE * TOLERANCE * f.drive2;
    w->report.ready = 1;
    w->report.rms = sqrt(f.r2);
    w->report.usual_rms = sqrt(usual);
    if (w->young_s < LEARN_S) return;
    if (!named && !excess) {
        w->calm_s += motion_s;
        if (w->calm_s > CALM_S) no_mismatch(w);
        return;
    }
    w->calm_s = 0;
    if (w->over_s == 0) { /* from here on only rows of the drive as it is now */
        w->first_over_ns = w->last_ns;
        w->over_s = 1e-9 * (double)w->row_ns;
        w->motion_s = 0;
        w->name = named && !f.open ? f.best : -1;
        w->named_before = w->name >= 0;
        clear_sums(w);
        return;
    }
    w->over_s += motion_s;
    w->unnamed_s = named ? 0 : w->unnamed_s + motion_s;
    if (settled(w, named && !f.open ? f.best : -1, motion_s)) report(w, &f, named);
    else if (!w->report.mismatch && (named ? w->over_s >= UNDECIDED_S : w->unnamed_s >= UNKNOWN_S)) report(w, &f, named);
}

static void row(driveid_watch *w, double dt_s) {
    double b[WATCH_BASE], z[WATCH_COLUMNS + WATCH_EACH] = {0}, drive2;
    base_row(w, b);
    const double speed = driveid_bank_value_f64(&w->base, w->motion_channel, w->motion_derivative);
    const double accel = driveid_bank_value_f64(&w->base, w->motion_channel, w->motion_derivative + 1u);
    follow_level(&w->speed2, speed * speed, dt_s);
    follow_level(&w->accel2, accel * accel, dt_s);
    const driveid_watch_regime regime = regime_of(w, speed, accel);
    w->still_s = regime == DRIVEID_WATCH_STANDSTILL ? w->still_s + dt_s : 0;
    w->asleep = w->still_s > ASLEEP_S;
    if (regime == DRIVEID_WATCH_STANDSTILL) return;
    const double decay = 1 - dt_s / WATCH_MEMORY_S;
    candidate_row(w, z);
    add_row(w, b, z, decay);
    watch_skew_row(w, b, z, dt_s);
    w->motion_s += dt_s;
    if (!w->has_reference) return;
    const double r = residual_of(w, b, &drive2);
    (void)driveid_monitor_feed(&w->monitor, r, drive2, 0, dt_s);
    follow_regimes(w, regime, r * r, decay, dt_s);
    w->look_s += dt_s;
    w->young_s += dt_s;
    if (w->look_s < WATCH_LOOK_S || w->motion_s < FRESH_S) return;
    look(w, w->look_s);
    w->look_s = 0;
}

void driveid_watch_sample(driveid_watch *w, const driveid_sample *sample) {
    double channel[DRIVEID_CHANNELS_MAX] = {0};
    if (w->online.mechanical < 0) return;
    const driveid_status status = driveid_online_channels(&w->online, sample, channel);
    if (status != DRIVEID_OK) {
        if (status == DRIVEID_FROZEN || status == DRIVEID_NOT_YET) w->running = 0;
        return;
    }
    const int64_t t_ns = w->online.t_ns, dt_ns = t_ns - w->last_ns;
    if (w->asleep) {
        w->running = 0;
        if (w->online.speed * w->online.speed < STILL * w->speed2) return;
        w->asleep = 0;
        w->still_s = 0;
    }
    const int starts = !w->running || dt_ns <= 0 || dt_ns > 10 * w->row_ns;
    if (starts) {
        start(w, t_ns, channel);
    } else {
        driveid_bank_step_f64(&w->base, dt_ns, channel, NULL);
        watch_filter_step(&w->column, dt_ns);
    }
    watch_fill(w, w->column.last);
    w->last_ns = t_ns;
    if (starts) return;
    const int64_t since = t_ns - w->last_row_ns;
    if (since + dt_ns / 2 < w->row_ns) return;
    w->last_row_ns = t_ns;
    if (t_ns - w->start_ns > w->settle_ns) row(w, 1e-9 * (double)since);
}

void driveid_watch_gap(driveid_watch *w) {
    driveid_online_gap(&w->online);
    w->running = 0;
}

/* ---- reference ---- */

static int usable(const driveid_watch *w, const driveid_estimate *e, driveid_status status, double *theta) {
    if (status != DRIVEID_OK && status != DRIVEID_FROZEN && status != DRIVEID_WEAK_EXCITATION) return 0;
    for (unsigned i = 0; i < e->params; i++) {
        if (w->place[i] >= w->params) continue;
        if (!(e->valid_mask >> i & 1)) return 0;
        theta[w->place[i]] = e->theta[i];
    }
    return 1;
}

/* The answer's own uncertainty, as a torque in the recent motion, is far below what is tolerated. */
static int sharp(const driveid_watch *w, const driveid_estimate *e, double limit) {
    double spread = 0, drive = w->bb[w->params][w->params];
    for (unsigned i = 0; i < e->params; i++)
        for (unsigned j = 0; j < e->params; j++)
            if (w->place[i] < w->params && w->place[j] < w->params) spread += e->cov[i * e->params + j] * w->bb[w->place[i]][w->place[j]];
    for (unsigned i = 0; i < e->params; i++)
        if (w->place[i] < w->params) drive = fmax(drive, e->theta[i] * e->theta[i] * w->bb[w->place[i]][w->place[i]]);
    return spread < limit * limit * drive;
}

/* A learnt reference is the mean of the answers while the drive was the same. */
static void refine(driveid_watch *w, const double *theta) {
    if (w->estimates < ESTIMATES_MAX) w->estimates++;
    for (unsigned i = 0; i < w->params; i++) w->reference[i] += (theta[i] - w->reference[i]) / w->estimates;
    w->motion_s = FRESH_S; /* the sums do not depend on the reference */
}

static void take(driveid_watch *w, const driveid_estimate *e, const double *theta) {
    memcpy(w->reference, theta, sizeof w->reference);
    for (unsigned i = 0; i < e->params; i++)
        if (w->place[i] < w->params) w->sigma[w->place[i]] = sqrt(e->cov[i * e->params + i]);
    w->has_reference = 1;
    driveid_monitor_init(&w->monitor, 0);
    memset(w->regime_usual, 0, sizeof w->regime_usual);
    clear_sums(w);
    no_mismatch(w);
    w->motion_s = w->young_s = 0;
    w->from_file = 0;
    w->estimates = 1;
}

void driveid_watch_estimate(driveid_watch *w, const driveid_estimate *e, driveid_status status) {
    double theta[WATCH_BASE] = {0};
    if (w->online.mechanical < 0 || !usable(w, e, status, theta) || !sharp(w, e, SHARP_FIRST)) return;
    if (!w->has_reference) {
        if (w->motion_s >= LEARN_S) take(w, e, theta);
        return;
    }
    if (!w->from_file && w->over_s == 0 && w->motion_s >= REFRESH_S && sharp(w, e, SHARP)) {
        refine(w, theta);
    }
    const int lacks = w->said >= 0 && !w->candidate[w->said].own; /* other parameters would only hide an effect that the model has not */
    if (!w->report.mismatch || lacks || w->over_s < FOLLOW_S) return;
    const watch_finding f = watch_find(w, theta);
    if (!explained(&f) && f.r2 < 0.25 * w->report.rms * w->report.rms) take(w, e, theta);
}
