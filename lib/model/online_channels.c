/* SPDX-License-Identifier: Apache-2.0 */
/* From samples to channels: speed out of the angle without lag, its sign with the crossing inside a step, rest. */
#include <driveid/model.h>

#include <math.h>
#include <string.h>

#include "model/online.h"

driveid_status driveid_online_hold(driveid_online *online, driveid_signal signal, driveid_hold hold) {
    if (!online || (unsigned)signal >= DRIVEID_SIGNAL_COUNT || (unsigned)hold > DRIVEID_HOLD_AVERAGE) return DRIVEID_ERR_ARGUMENT;
    driveid_status status = DRIVEID_ERR_ARGUMENT;
    for (unsigned c = 0; c < online->regression.channels; c++) {
        const driveid_online_channel *f = &online->filler[c];
        const int uses = (f->kind == ONLINE_SIGNAL || f->kind == ONLINE_SPEED_TIMES || f->kind == ONLINE_DELAYED) && f->a == signal;
        if (!uses) continue;
        if (f->kind != ONLINE_SPEED_TIMES) online->regression.hold[c] = (uint8_t)hold;
        status = DRIVEID_OK;
    }
    return status;
}

/* Slope of a straight line through the ring's readings: the speed at its middle, without lag. */
static double slope(const driveid_online *o) {
    const int64_t origin = o->ring[DRIVEID_ONLINE_DELAY].stamp.t_ns;
    const double base = o->ring[DRIVEID_ONLINE_DELAY].value[o->motion];
    double t1 = 0, t2 = 0, y1 = 0, ty = 0;
    for (int i = 0; i < DRIVEID_ONLINE_RING; i++) {
        const double t = 1e-9 * (double)(o->ring[i].stamp.t_ns - origin), y = o->ring[i].value[o->motion] - base;
        t1 += t;
        t2 += t * t;
        y1 += y;
        ty += t * y;
    }
    return (ty - t1 * y1 / DRIVEID_ONLINE_RING) / (t2 - t1 * t1 / DRIVEID_ONLINE_RING);
}

/* Typical size of the speed's noise: slow mean of its roughness, so that rest is told from slow motion. */
static void follow_noise(driveid_online *o, double speed) {
    const double rough = fabs(speed - o->speed);
    o->noise += (rough < o->noise ? 0.02 : 0.002) * (rough - o->noise);
}

static int at_rest(const driveid_online *o) {
    return fabs(o->speed) <= 3 * o->noise && fabs(o->last_speed) <= 3 * o->noise;
}

/* Mean of sign(speed) over the step, speed taken as linear in it. */
static double mean_sign(double before, double now) {
    const double s0 = (before > 0) - (before < 0), s1 = (now > 0) - (now < 0);
    if (s0 * s1 >= 0) return s1 != 0 ? s1 : s0;
    const double f = fabs(before) / (fabs(before) + fabs(now));
    return s0 * f + s1 * (1 - f);
}

static driveid_status push(driveid_online *o, const driveid_sample *sample) {
    const int64_t dt = o->ring_fill ? sample->stamp.t_ns - o->ring[0].stamp.t_ns : 1;
    if (dt <= 0) return dt < 0 ? DRIVEID_ERR_TIME : DRIVEID_DUPLICATE;
    if (o->ring_fill > 0) {
        const double dt_s = 1e-9 * (double)dt;
        o->dt_s = o->dt_s > 0 ? o->dt_s + 0.01 * (fmin(dt_s, 2 * o->dt_s) - o->dt_s) : dt_s;
    }
    if (o->ring_fill > 1) {
        const int64_t usual = o->ring[0].stamp.t_ns - o->ring[1].stamp.t_ns;
        if (dt > 5 * usual) o->ring_fill = o->past_fill = 0; /* no line through a gap */
    }
    memmove(o->ring + 1, o->ring, (DRIVEID_ONLINE_RING - 1) * sizeof o->ring[0]);
    o->ring[0] = *sample;
    if (o->ring_fill < DRIVEID_ONLINE_RING) o->ring_fill++;
    if (o->delay_s > 0) online_remember(o, sample);
    return o->ring_fill < (o->delayed ? DRIVEID_ONLINE_RING : 1) ? DRIVEID_NOT_YET : DRIVEID_OK;
}

void driveid_online_gap(driveid_online *online) {
    if (online) online->ring_fill = online->past_fill = 0;
}

static double fill(driveid_online *o, const driveid_sample *sample, const driveid_online_channel *f) {
    switch (f->kind) {
    case ONLINE_SIGNAL: return sample->value[f->a];
    case ONLINE_PRODUCT: return sample->value[f->a] * sample->value[f->b];
    case ONLINE_SPEED_TIMES: return o->speed * sample->value[f->a];
    case ONLINE_SIGN: return mean_sign(o->last_speed, o->speed);
    case ONLINE_LOSS: return online_losses(o, sample, f->a);
    case ONLINE_DELAYED: return online_delayed(o, sample->stamp.t_ns);
    default: return 1;
    }
}

void driveid_online_ranges(const driveid_online *online, const double *signal_range, double *channel_range) {
    const int linear = online->motion == DRIVEID_SIGNAL_X_M || online->motion == DRIVEID_SIGNAL_V_M_S;
    const double speed = signal_range[linear ? DRIVEID_SIGNAL_V_M_S : DRIVEID_SIGNAL_OMEGA_RAD_S];
    for (unsigned c = 0; c < online->regression.channels; c++) {
        const driveid_online_channel *f = &online->filler[c];
        channel_range[c] = f->kind == ONLINE_SIGNAL ? signal_range[f->a] : f->kind == ONLINE_PRODUCT ? signal_range[f->a] * signal_range[f->b]
                         : f->kind == ONLINE_SPEED_TIMES ? speed * signal_range[f->a] : 1;
    }
}

driveid_status driveid_online_channels(driveid_online *online, const driveid_sample *sample, double *channel) {
    if (!online || !sample || !channel) return DRIVEID_ERR_ARGUMENT;
    if ((sample->present & online->present) != online->present) return DRIVEID_NOT_YET;
    for (unsigned s = 0; s < DRIVEID_SIGNAL_COUNT; s++)
        if ((online->present >> s & 1) && !isfinite(sample->value[s])) return DRIVEID_ERR_VALUE;
    const driveid_status status = push(online, sample);
    if (status) return status;
    const driveid_sample *use = &online->ring[online->delayed];
    if (online->uses_speed) {
        const double speed = online->delayed ? slope(online) : use->value[online->motion];
        follow_noise(online, speed);
        online->last_speed = online->speed;
        online->speed = speed;
    }
    if (online->rest_matters && at_rest(online)) return DRIVEID_FROZEN;
    for (unsigned c = 0; c < online->regression.channels; c++) channel[c] = fill(online, use, &online->filler[c]);
    online->t_ns = use->stamp.t_ns;
    return DRIVEID_OK;
}
