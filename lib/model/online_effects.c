/* SPDX-License-Identifier: Apache-2.0 */
/* Effects of the loaded model on line: they run with the values of the model file, as one known term of their equation. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "model/online.h"

#define SETTLED_S 1e6 /* time since the start of a record, for drifts: on line the drift is over */

static online_part refuse(char *why, size_t size, const driveid_effect_use *use, const char *text) {
    snprintf(why, size, "effect %s %s", use->name, text);
    return ONLINE_PART_NONE;
}

static int has_values(const driveid_effect_use *use) {
    for (uint32_t i = 0; i < use->params; i++)
        if (use->param[i].state == DRIVEID_PARAM_UNSET) return 0;
    return 1;
}

static void gather(const driveid_effect_use *use, double *value) {
    for (uint32_t i = 0; i < use->params; i++) value[i] = use->param[i].value;
}

static online_part enter_formula(driveid_online *o, uint32_t k, char *why, size_t size) {
    const driveid_effect_use *use = &o->model.effect[k];
    for (unsigned i = 0; i < o->losses; i++)
        if (o->loss[i].own) return refuse(why, size, use, "is the second own formula: one runs on line");
    if (driveid_formula_parse(use->formula, &o->formula, why, size)) return ONLINE_PART_NONE;
    driveid_online_loss *loss = &o->loss[o->losses++];
    *loss = (driveid_online_loss){.effect = (uint8_t)k, .own = 1, .electrical = strcmp(use->adds_to, "v_V") == 0};
    for (uint32_t f = 0; f < o->formula.params; f++)
        for (uint32_t i = 0; i < use->params; i++)
            if (strcmp(o->formula.param[f], use->param[i].name) == 0) loss->linear[f] = use->param[i].value;
    return ONLINE_PART_LOSS;
}

online_part online_enter_effect(driveid_online *o, uint32_t k, double *value, char *why, size_t size) {
    const driveid_effect_use *use = &o->model.effect[k];
    const driveid_effect_info *info = driveid_effect_find(use->name);
    double param[DRIVEID_PARAMS_MAX];
    if (!has_values(use)) return refuse(why, size, use, "has no values yet: fit the model to a record");
    gather(use, param);
    if (strcmp(use->name, "delay") == 0) {
        *value = param[0];
        return ONLINE_PART_DELAY;
    }
    if (strcmp(use->name, "inertia_change") == 0) {
        *value = param[0];
        return ONLINE_PART_INERTIA;
    }
    if (o->losses >= DRIVEID_ONLINE_LOSSES) return refuse(why, size, use, "is one too many for the on-line form");
    if (!info) return enter_formula(o, k, why, size);
    if (info->columns == 0) return refuse(why, size, use, "does not run on line: compare a record off-line");
    driveid_online_loss *loss = &o->loss[o->losses++];
    *loss = (driveid_online_loss){.effect = (uint8_t)k, .electrical = !(info->domains & DRIVEID_EFFECT_MECHANICAL)};
    (void)driveid_effect_resolve(info, param, o->drive_gain, loss->shape, loss->linear);
    return ONLINE_PART_LOSS;
}

static double or_zero(const driveid_sample *s, driveid_signal signal) { return s->present >> signal & 1 ? s->value[signal] : 0; }

static driveid_effect_state state_at(const driveid_online *o, const driveid_sample *s, int electrical) {
    driveid_effect_state x = {.t_s = SETTLED_S, .dt_s = o->dt_s, .speed = o->speed, .gain = o->drive_gain, .electrical = (uint8_t)electrical};
    x.angle = or_zero(s, DRIVEID_SIGNAL_THETA_RAD) + or_zero(s, DRIVEID_SIGNAL_X_M);
    x.direction = (o->speed > 0) - (o->speed < 0);
    x.drive = or_zero(s, (driveid_signal)o->drive);
    x.torque = o->drive_gain * x.drive;
    x.voltage_V = or_zero(s, DRIVEID_SIGNAL_V_V) + or_zero(s, DRIVEID_SIGNAL_V_Q_V);
    x.current_A = or_zero(s, DRIVEID_SIGNAL_I_A) + or_zero(s, DRIVEID_SIGNAL_I_Q_A);
    x.has_temperature = s->present >> DRIVEID_SIGNAL_T_DEGC & 1;
    x.T_degC = or_zero(s, DRIVEID_SIGNAL_T_DEGC);
    return x;
}

double online_losses(driveid_online *o, const driveid_sample *sample, int electrical) {
    const driveid_effect_state at = state_at(o, sample, electrical);
    double sum = 0, column[DRIVEID_EFFECT_COLUMNS_MAX];
    for (unsigned i = 0; i < o->losses; i++) {
        driveid_online_loss *loss = &o->loss[i];
        if (loss->electrical != electrical) continue;
        if (loss->own) {
            sum += driveid_formula_value(&o->formula, &at, loss->linear, NULL);
            continue;
        }
        const driveid_effect_info *info = driveid_effect_find(o->model.effect[loss->effect].name);
        if (driveid_effect_columns(info, loss->shape, &at, loss->memory, column)) continue;
        for (unsigned c = 0; c < info->columns; c++) sum += loss->linear[c] * column[c];
    }
    return sum;
}

void online_remember(driveid_online *o, const driveid_sample *sample) {
    o->past_next = (uint8_t)((o->past_next + 1) % DRIVEID_ONLINE_PAST);
    o->past[o->past_next] = sample->value[o->drive];
    o->past_ns[o->past_next] = sample->stamp.t_ns;
    if (o->past_fill < DRIVEID_ONLINE_PAST) o->past_fill++;
}

/* A straight line between the two readings around the instant; the oldest one where the dead time is longer than what is kept. */
double online_delayed(const driveid_online *o, int64_t t_ns) {
    const int64_t then = t_ns - (int64_t)(1e9 * o->delay_s);
    unsigned at = o->past_next;
    for (unsigned back = 1; back < o->past_fill; back++) {
        const unsigned older = (o->past_next + DRIVEID_ONLINE_PAST - back) % DRIVEID_ONLINE_PAST;
        if (o->past_ns[older] <= then) {
            const double whole = (double)(o->past_ns[at] - o->past_ns[older]), part = (double)(then - o->past_ns[older]);
            return o->past[older] + (whole > 0 ? fmin(1, part / whole) : 0) * (o->past[at] - o->past[older]);
        }
        at = older;
    }
    return o->past[at];
}
