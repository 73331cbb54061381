/* SPDX-License-Identifier: Apache-2.0 */
/* The linear effects of the catalogue as columns of a watch. */
#include <math.h>
#include <string.h>

#include "model_watch_state.h"

static int index_of(const char *name) {
    for (uint32_t i = 0; i < driveid_effect_count(); i++)
        if (strcmp(driveid_effect_at(i)->name, name) == 0) return (int)i;
    return -1;
}

static int model_has(const driveid_watch *w, const char *name) {
    for (uint32_t i = 0; i < w->online.model.effects; i++)
        if (strcmp(w->online.model.effect[i].name, name) == 0) return 1;
    return 0;
}

static watch_candidate *add(driveid_watch *w, const char *name, unsigned columns) {
    if (w->candidates >= WATCH_CANDIDATES || w->columns + columns > WATCH_COLUMNS) return NULL;
    watch_candidate *c = &w->candidate[w->candidates++];
    *c = (watch_candidate){.effect = (uint8_t)index_of(name), .columns = (uint8_t)columns, .first = w->columns};
    w->columns = (uint8_t)(w->columns + columns);
    return c;
}

/* Behind banks: the catalogue's own columns at a shape. */
static void add_fed(driveid_watch *w, const char *name, double shape) {
    const driveid_effect_info *info = driveid_effect_find(name);
    if (info->columns > WATCH_EACH) return;
    watch_candidate *c = add(w, name, info->columns);
    if (!c) return;
    c->shape[0] = shape;
    c->product = strcmp(name, "load_dependent_friction") == 0 || strcmp(name, "torque_saturation") == 0 || strcmp(name, "torque_ripple") == 0;
    if (info->shapes && info->shape[0].dimension == DRIVEID_DIM_ORDER) c->order = shape;
}

static void add_tap(driveid_watch *w, const watch_candidate *c, unsigned column, unsigned channel, unsigned derivative, double factor) {
    if (c) w->tap[w->taps++] = (watch_tap){(uint8_t)(c->first + column), (uint8_t)channel, (uint8_t)derivative, factor};
}

static int drive_channel(const driveid_online *o) {
    for (unsigned c = 0; c < o->regression.channels; c++) {
        const driveid_term *t = o->regression.term;
        if (o->filler[c].a != o->drive) continue;
        for (unsigned i = 0; i < o->regression.terms; i++)
            if (t[i].equation == o->mechanical && t[i].channel == c && t[i].derivative == 0) return (int)c;
    }
    return -1;
}

static unsigned model_has_dry(const driveid_watch *w) {
    static const char *const dry[] = {"coulomb", "stribeck", "lugre", "asymmetric_friction", "eccentric_friction"};
    for (unsigned i = 0; i < sizeof dry / sizeof *dry; i++)
        if (model_has(w, dry[i])) return 1;
    return 0;
}

/* Changes of what the model has: the equation's own terms; of friction the sign too where it has dry friction. */
static void list_own(driveid_watch *w) {
    const unsigned d = w->motion_derivative;
    watch_candidate *c = add(w, "inertia_change", 1);
    if (c) c->own = 1;
    add_tap(w, c, 0, w->motion_channel, d + 1, 1);
    const unsigned dry = model_has_dry(w);
    c = add(w, "friction_drift", dry ? 2 : 1);
    if (c) c->own = 1;
    add_tap(w, c, dry, w->motion_channel, d, 1);
    const int drive = drive_channel(&w->online);
    if (drive < 0) return;
    c = add(w, "delay", 1);
    add_tap(w, c, 0, (unsigned)drive, 1, w->online.drive_gain);
}

void watch_list(driveid_watch *w) {
    const int linear = w->online.model.structure == DRIVEID_STRUCTURE_LINEAR_AXIS;
    const int angle = w->online.present >> DRIVEID_SIGNAL_THETA_RAD & 1;
    const double slow = linear ? 0.002 : 0.5;
    list_own(w);
    if (!model_has(w, "coulomb")) add_fed(w, "coulomb", 0);
    add_fed(w, "constant_load", 0);
    add_fed(w, "asymmetric_friction", 0);
    add_fed(w, "quadratic_drag", 0);
    add_fed(w, "load_dependent_friction", 0);
    add_fed(w, "torque_saturation", 2);
    for (int k = 0; k < 3; k++) add_fed(w, "stribeck", slow * pow(4, k));
    w->periodic = w->candidates;
    if (!angle) return;
    add_fed(w, "gravity_unbalance", 0);
    for (int n = 1; n <= 2; n++) add_fed(w, "eccentric_friction", n);
    w->periodic = w->candidates;
    w->cogging = w->columns;
    for (int n = 2; n <= WATCH_ORDERS; n++) add_fed(w, "cogging", n);
    w->ripple = w->columns;
    for (int n = 1; n <= WATCH_ORDERS / 2; n++) add_fed(w, "torque_ripple", n);
}

static driveid_effect_state state_of(const driveid_watch *w) {
    const driveid_online *o = &w->online;
    const driveid_sample *s = &o->ring[o->delayed];
    driveid_effect_state x = {.t_s = 1e6, .dt_s = o->dt_s, .speed = o->speed, .gain = o->drive_gain};
    x.direction = (o->speed > 0) - (o->speed < 0);
    x.angle = o->present >> DRIVEID_SIGNAL_THETA_RAD & 1 ? s->value[DRIVEID_SIGNAL_THETA_RAD] : o->present >> DRIVEID_SIGNAL_X_M & 1 ? s->value[DRIVEID_SIGNAL_X_M] : 0;
    x.drive = s->value[o->drive];
    x.torque = x.gain * x.drive;
    return x;
}

/* sin and cos of n angle for n = 1, 2, ...: odd and even n each turn on by twice the angle. An order that turns too fast for the samples is left out. */
static void fill_periodic(const driveid_watch *w, const driveid_effect_state *x, double *column) {
    const double s1 = sin(x->angle), c1 = cos(x->angle), s2 = 2 * s1 * c1, c2 = 1 - 2 * s1 * s1, per_sample = fabs(x->speed) * x->dt_s;
    const int fastest = per_sample * WATCH_ORDERS > 1 ? (int)(1 / per_sample) : WATCH_ORDERS;
    double pair[2 * WATCH_ORDERS + 4] = {s1, c1, s2, c2}; /* of order n at 2 (n - 1) */
    for (int k = 4; k < 2 * fastest; k += 2) {
        pair[k] = pair[k - 4] * c2 + pair[k - 3] * s2;
        pair[k + 1] = pair[k - 3] * c2 - pair[k - 4] * s2;
    }
    const int cogging = fastest, ripple = fastest < WATCH_ORDERS / 2 ? fastest : WATCH_ORDERS / 2;
    if (cogging > 1) memcpy(column + w->cogging, pair + 2, 2 * (size_t)(cogging - 1) * sizeof *pair);
    for (int k = 0; k < 2 * ripple; k++) column[w->ripple + k] = x->torque * pair[k];
}

void watch_fill(const driveid_watch *w, double *column) {
    const driveid_effect_state x = state_of(w);
    double memory[DRIVEID_EFFECT_MEMORY] = {0};
    memset(column, 0, WATCH_COLUMNS * sizeof *column);
    for (unsigned k = 0; k < w->periodic; k++) {
        const watch_candidate *c = &w->candidate[k];
        const driveid_effect_info *info = driveid_effect_at(c->effect);
        if (!c->own && info->columns) (void)driveid_effect_columns(info, c->shape, &x, memory, column + c->first);
    }
    if (w->candidate[1].columns > 1) column[w->candidate[1].first] = x.direction; /* of friction_drift */
    if (w->periodic < w->candidates) fill_periodic(w, &x, column);
}
