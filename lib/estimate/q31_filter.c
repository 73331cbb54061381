/* SPDX-License-Identifier: Apache-2.0 */
#include "q31.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/fixed.h"

/* Bits that a derivative's column is brought up by, an order. */
static unsigned boost(const q31_state *self) { return self->kind >= Q31_WINDOW ? 1 : 3; }

/* Coefficients of base/bank.inc at the one sample time, by the same tails of the Poisson distribution. */
static void prepare_bank(q31_state *self) {
    enum { TAIL = 24 };
    const unsigned sections = self->common.sections;
    const double x = self->common.options.bandwidth_rad_s * self->common.options.dt_s;
    double p[DRIVEID_SECTIONS_MAX + TAIL], tail = 0, ramp = 0, square = 0;
    p[0] = exp(-x);
    for (unsigned k = 1; k < sections + TAIL; k++) p[k] = p[k - 1] * x / k;
    for (unsigned m = sections + TAIL; m-- > 1;) {
        tail += p[m];
        if (m <= sections) {
            self->f[m - 1] = fixed_q31(1 - ramp / x);
            self->q[m - 1] = fixed_q31(2 * square / (x * x) - ramp / x);
        }
        square += ramp;
        ramp += tail;
    }
    for (unsigned k = 0; k < sections; k++) self->p[k] = fixed_q31(p[k]);
}

enum { LONGEST = DRIVEID_Q31_RING < KERNEL_SAMPLES ? DRIVEID_Q31_RING : KERNEL_SAMPLES };

/* Weights of each shape so that their magnitudes add up to one; total[shape] is what that took. */
static int prepare_window(q31_state *self, double *total) {
    static const kernel_weights weights[2] = {kernel_window_weights, kernel_discrete_weights};
    kernel_shape shape[KERNEL_SHAPES];
    double u[LONGEST], w[LONGEST];
    const driveid_estimator_options *o = &self->common.options;
    const int shapes = kernel_shapes(&self->common, shape, self->of_term);
    const double least = fmax(20 / (o->bandwidth_rad_s * o->dt_s), 6.0 * (self->common.sections - 1));
    const int n = 4 * (int)ceil(least / 4);
    if (!shapes || n >= LONGEST || (n + 1) * self->common.regression.channels > DRIVEID_Q31_RING || (n + 1) * shapes > DRIVEID_Q31_WEIGHTS) return 0;
    self->length = (uint16_t)n;
    for (int i = 0; i <= n; i++) u[i] = (double)i / n;
    for (int s = 0; s < shapes; s++) {
        weights[self->kind == Q31_DISCRETE](&shape[s], u, n, n * o->dt_s, w);
        total[s] = 0;
        for (int i = 0; i <= n; i++) total[s] += fabs(w[i]);
        for (int i = 0; i <= n; i++) self->weight[s * (n + 1) + i] = fixed_q31(w[i] / total[s]);
    }
    return 1;
}

/* Each column's unit is the largest of its terms; a term's gain is its part of that. */
static void prepare_terms(q31_state *self, const double *total) {
    const driveid_regression *r = &self->common.regression;
    double size[DRIVEID_TERMS_MAX];
    for (unsigned i = 0; i < r->terms; i++) {
        const driveid_term *t = &r->term[i];
        const double unit = total ? total[self->of_term[i]] : pow(self->common.options.bandwidth_rad_s, t->derivative);
        const fsm_equation *q = &self->common.equation[t->equation];
        double *scale = &self->scale[t->equation][t->param < 0 ? q->columns - 1 : q->place[t->param]];
        size[i] = fabs(t->factor) * unit / self->count_per_SI[t->channel] * ldexp(1, -(int)boost(self) * t->derivative);
        *scale += size[i]; /* terms that share a column add up */
    }
    for (unsigned i = 0; i < r->terms; i++) {
        const driveid_term *t = &r->term[i];
        const fsm_equation *q = &self->common.equation[t->equation];
        const double sign = (t->factor < 0 ? -1 : 1) * (t->param < 0 ? -1 : 1);
        self->gain[i] = fixed_q31(sign * size[i] / self->scale[t->equation][t->param < 0 ? q->columns - 1 : q->place[t->param]]);
        self->shift[i] = (uint8_t)(31 - boost(self) * t->derivative);
    }
    for (unsigned e = 0; e < r->equations; e++)
        for (unsigned i = 0; i < self->common.equation[e].order; i++) self->scale[e][self->common.equation[e].params + i] = 1;
}

driveid_status q31_prepare(q31_state *self, char *reason, size_t reason_size) {
    double total[KERNEL_SHAPES];
    const int window = self->kind >= Q31_WINDOW;
    if (!window) prepare_bank(self);
    else if (!prepare_window(self, total)) {
        if (reason && reason_size) snprintf(reason, reason_size, "the window does not fit the fixed memory: take a higher bandwidth_rad_s or sample more slowly");
        return DRIVEID_ERR_CONFIG;
    }
    prepare_terms(self, window ? total : NULL);
    return DRIVEID_OK;
}

/* Wraps where only differences count. */
static int32_t difference(int32_t a, int32_t b) { return (int32_t)((uint32_t)a - (uint32_t)b); }

static void push(q31_state *self, const int32_t *count) {
    const unsigned channels = self->common.regression.channels;
    self->newest = self->newest == self->length ? 0 : (uint16_t)(self->newest + 1);
    memcpy(self->ring + self->newest * channels, count, channels * sizeof *count);
    if (self->fill <= self->length) self->fill++;
}

void q31_filter_start(q31_state *self, const int32_t *count) {
    const unsigned channels = self->common.regression.channels, sections = self->common.sections;
    memset(self->w, 0, sizeof self->w);
    memset(self->move, 0, sizeof self->move);
    memcpy(self->input, count, channels * sizeof *count);
    self->fill = 0;
    if (self->kind >= Q31_WINDOW) {
        push(self, count);
        return;
    }
    for (unsigned c = 0; c < channels; c++) {
        const int average = self->common.regression.hold[c] == DRIVEID_HOLD_AVERAGE;
        for (unsigned j = 0; j < sections && self->level[c] && !average; j++) self->w[c][j] = fixed_saturate(-(int64_t)count[c], &self->saturations);
        if (average && self->level[c]) self->input[c] = 0;
    }
    self->w[channels][0] = self->fresh ? FIXED_UNIT : 0;
}

/* w = P w + q bend - f move, one section after the other from the last, so in place. */
static void step_section(q31_state *self, int32_t *w, int64_t bend, int64_t ramp, int32_t jump) {
    for (unsigned i = self->common.sections; i-- > 0;) {
        int64_t sum = self->q[i] * bend - self->f[i] * ramp;
        for (unsigned j = 0; j <= i; j++) sum += (int64_t)self->p[i - j] * w[j];
        w[i] = fixed_saturate(fixed_round(sum, 31) - jump, &self->saturations);
    }
}

void q31_filter_step(q31_state *self, const int32_t *count) {
    const unsigned channels = self->common.regression.channels, sections = self->common.sections;
    if (self->kind >= Q31_WINDOW) {
        push(self, count);
        return;
    }
    for (unsigned c = 0; c < channels; c++) {
        int32_t *w = self->w[c];
        const int32_t move = difference(count[c], self->input[c]);
        self->input[c] = count[c];
        if (self->common.regression.hold[c] == DRIVEID_HOLD_FIRST) {
            step_section(self, w, self->fill ? ((int64_t)move - self->move[c]) / 2 : 0, move, 0); /* no bend is known on the first */
            self->move[c] = move;
        } else if (self->common.regression.hold[c] == DRIVEID_HOLD_ZERO) {
            step_section(self, w, 0, 0, move);
        } else {
            for (unsigned j = 0; j < sections; j++) w[j] = fixed_saturate((int64_t)w[j] - move, &self->saturations);
            step_section(self, w, 0, 0, 0);
        }
    }
    if (self->fresh) step_section(self, self->w[channels], 0, 0, 0);
    self->fill = 1;
}

static int64_t newton(const int32_t *w, unsigned sections, unsigned derivative) {
    int64_t sum = 0, binomial = 1;
    for (unsigned m = 0; m <= derivative && m < sections; m++) {
        sum += ((derivative - m) & 1 ? -binomial : binomial) * w[sections - 1 - m];
        binomial = binomial * (derivative - m) / (m + 1);
    }
    return sum;
}

static int64_t weigh(const q31_state *self, const int32_t *weight, unsigned channel, unsigned derivative) {
    const unsigned channels = self->common.regression.channels, last = self->length;
    unsigned at = self->newest == last ? 0 : self->newest + 1u; /* the oldest */
    const int32_t from = derivative ? self->ring[at * channels + channel] : 0;
    int64_t sum = 0;
    for (unsigned i = 0; i <= last; i++, at = at == last ? 0 : at + 1) sum += (int64_t)weight[i] * difference(self->ring[at * channels + channel], from);
    return fixed_round(sum, 31);
}

static int64_t value_of(const q31_state *self, unsigned term) {
    const driveid_term *t = &self->common.regression.term[term];
    if (self->kind >= Q31_WINDOW) return weigh(self, self->weight + self->of_term[term] * (self->length + 1u), t->channel, t->derivative);
    return newton(self->w[t->channel], self->common.sections, t->derivative) + (t->derivative ? 0 : self->input[t->channel]);
}

int q31_row(q31_state *self, unsigned e, int32_t *row) {
    const driveid_regression *r = &self->common.regression;
    const fsm_equation *q = &self->common.equation[e];
    uint32_t beyond = 0;
    int64_t sum[FSM_COLUMNS_MAX] = {0};
    if (self->kind >= Q31_WINDOW && self->fill <= self->length) return 0;
    for (unsigned i = 0; i < r->terms; i++) {
        const driveid_term *t = &r->term[i];
        if (t->equation != e) continue;
        const int32_t value = fixed_saturate(value_of(self, i), &beyond);
        sum[t->param < 0 ? q->columns - 1u : q->place[t->param]] += fixed_round((int64_t)value * self->gain[i], self->shift[i]);
    }
    for (unsigned i = 0; i < q->order && self->fresh; i++) sum[q->params + i] = newton(self->w[r->channels], self->common.sections, i);
    for (unsigned i = 0; i < q->columns; i++) row[i] = fixed_saturate(sum[i], &beyond);
    self->rows_left_out += beyond > 0;
    return beyond == 0;
}
