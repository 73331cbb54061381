/* SPDX-License-Identifier: Apache-2.0 */
#include "tones.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include <driveid/frequency.h>

#include "base/solve.h"

#define PI 3.14159265358979323846
#define PERIODS 5.0      /* of the lowest frequency, and of the beat of two: memory of the amplitudes */
#define MEMORY_LEAST 0.5 /* s */
#define TURNED 0.3       /* rad over the memory: the sums belong to other frequencies */
#define STANDS_OUT 5.0   /* standard deviations of an amplitude that is there */
#define FILLED 0.4       /* of the memory, before there is a fit */
#define JUDGED 0.25      /* and its errors, before it is said */
#define LOST 0.35        /* of the power of the weakest: unexplained; of one that vanishes less is left after a memory and a half */
#define DRIFT 0.25       /* rad over the memory: another frequency */

int tones_configure(tones *self, driveid_svf_common *common, char *reason, size_t reason_size) {
    const driveid_regression *r = &common->regression;
    driveid_regression wanted;
    memset(self, 0, sizeof *self);
    const int fits = driveid_frequency_regression(r->params, 0, &wanted) == DRIVEID_OK && r->channels == 1 && r->terms == wanted.terms &&
                     memcmp(r->term, wanted.term, sizeof wanted.term) == 0 && 2u * r->params <= DRIVEID_THETA_MAX;
    if (!fits) {
        if (reason && reason_size) snprintf(reason, reason_size, "method frequency takes the regression of driveid_frequency_regression(), one or two sinusoids");
        return 0;
    }
    self->sinusoids = r->params;
    self->dt_s = common->options.dt_s;
    self->unit = common->options.range[0] / 1073741824.0;
    self->status = DRIVEID_NOT_YET;
    common->options.model_error = 0; /* what q has beside s is no error here */
    self->alarms = common->options.alarm >= 0;
    driveid_monitor_init(&common->monitor[0], -1); /* the phases tell a change sooner and more surely */
    return 1;
}

static void clear(tones *self) {
    memset(self->s, 0, sizeof self->s);
    self->weight = self->weight2 = self->held_s = self->error = self->noise = self->lag = self->judged = 0;
    memset(self->fit, 0, sizeof self->fit);
    memset(self->drift_rad_s, 0, sizeof self->drift_rad_s);
    self->fitted = self->marked = 0;
}

void tones_restart(tones *self) {
    clear(self);
    self->known = self->changed = 0;
    self->omega_ns = self->solve_ns = self->lost_ns = 0;
    self->usual[0] = self->usual[1] = self->quiet = 0;
    self->status = DRIVEID_NOT_YET;
    memset(&self->answer, 0, sizeof self->answer);
}

/* The frequency whose q is found, and the slope of that. */
static double unwarped(double omega, double dt_s, double *slope) {
    const double x = omega * dt_s / 2;
    *slope = 1 / (1 + x * x);
    return 2 / dt_s * atan(x);
}

static void renew(tones *self, const driveid_svf_common *common) {
    driveid_frequency f;
    self->omega_ns = common->answer.t_ns;
    if (driveid_frequency_read(&common->answer, &f) != DRIVEID_OK) {
        self->known = 0;
        return;
    }
    double turned = 0, omega[2] = {0};
    for (unsigned i = 0; i < self->sinusoids; i++) {
        double slope;
        omega[i] = unwarped(f.omega_rad_s[i], self->dt_s, &slope);
        self->half_rad_s[i] = slope * (f.hi_rad_s[i] - f.lo_rad_s[i]) / 2;
        self->mark_half_rad_s[i] = fmax(self->mark_half_rad_s[i], self->half_rad_s[i]); /* the worst since the mark */
        turned = fmax(turned, fabs(omega[i] - self->omega_rad_s[i]) * self->memory_s);
    }
    memcpy(self->omega_rad_s, omega, sizeof omega);
    if (self->known && turned < TURNED) return;
    const double beat = self->sinusoids == 2 ? fmin(omega[0], omega[1] - omega[0]) : omega[0];
    self->memory_s = fmin(fmax(MEMORY_LEAST, PERIODS * 2 * PI / beat), common->options.forgetting_s);
    self->known = 1;
    clear(self);
}

static void regressors(const tones *self, double *x) {
    x[0] = 1;
    for (unsigned i = 0; i < self->sinusoids; i++) {
        x[2 * i + 1] = cos(self->phase[i]);
        x[2 * i + 2] = sin(self->phase[i]);
    }
    x[2 * self->sinusoids + 1] = self->y - self->origin;
}

static void add(tones *self, double dt_s) {
    const unsigned n = 2u * self->sinusoids + 2;
    const double decay = exp(-dt_s / self->memory_s);
    double x[TONES_COLUMNS];
    for (unsigned i = 0; i < self->sinusoids; i++) self->phase[i] = fmod(self->phase[i] + self->omega_rad_s[i] * dt_s, 2 * PI);
    regressors(self, x);
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j <= i; j++) self->s[i * n + j] = decay * self->s[i * n + j] + x[i] * x[j];
    self->weight = decay * self->weight + 1;
    self->weight2 = decay * decay * self->weight2 + 1;
    self->held_s += dt_s;
    if (!self->fitted) return;
    double error = x[n - 1];
    for (unsigned i = 0; i + 1 < n; i++) error -= self->fit[i] * x[i];
    self->noise = decay * self->noise + error * error;
    self->lag = decay * self->lag + error * self->error;
    self->judged = decay * self->judged + 1;
    self->error = error;
}

/* Least squares at the frequencies; 0: not yet. cov: of the columns but y. */
static int fit(tones *self, double *cov) {
    const unsigned n = 2u * self->sinusoids + 2, m = n - 1;
    double a[25], pivot[5];
    if (!self->known || self->held_s < FILLED * self->memory_s || self->weight < 4.0 * n) return 0;
    for (unsigned i = 0; i < m; i++)
        for (unsigned j = 0; j <= i; j++) a[i * m + j] = a[j * m + i] = self->s[i * n + j];
    if (driveid_solve_inverse(a, (int)m, 1e-6, cov, pivot) < (int)m) return 0;
    double rest = self->s[m * n + m];
    for (unsigned i = 0; i < m; i++) {
        self->fit[i] = 0;
        for (unsigned j = 0; j < m; j++) self->fit[i] += cov[i * m + j] * self->s[m * n + j];
        rest -= self->fit[i] * self->s[m * n + i];
    }
    /* A residual that hangs together from sample to sample tells less; of one that swings against itself nothing is made. */
    const double together = self->noise > 0 ? fmin(fmax(self->lag / self->noise, 0), 0.999) : 0;
    const double variance = fmax(rest, 0) / (self->weight - m * self->weight2 / self->weight) * self->weight2 / self->weight;
    self->together = (1 + together) / (1 - together);
    for (unsigned i = 0; i < m * m; i++) cov[i] *= variance;
    self->fitted = 1;
    return self->judged > JUDGED * self->weight;
}

static double amplitude_of(const tones *self, unsigned i) { return hypot(self->fit[2 * i + 1], self->fit[2 * i + 2]); }

/* Deviation of the amplitude, or of the phase times the amplitude. */
static double deviation_of(const tones *self, unsigned i, const double *cov) {
    const unsigned m = 2u * self->sinusoids + 1, c = 2 * i + 1, s = c + 1;
    const double x = self->fit[c], y = self->fit[s], a = amplitude_of(self, i);
    return a > 0 ? sqrt(fmax(0, x * x * cov[c * m + c] + 2 * x * y * cov[c * m + s] + y * y * cov[s * m + s])) / a : INFINITY;
}

/* How the fitted phases turn from one memory to the next; 1: too far. */
static int follow_phases(tones *self, const double *cov, int64_t t_ns) {
    const double passed_s = 1e-9 * (double)(t_ns - self->mark_ns);
    int far = 0;
    if (self->marked && passed_s < self->memory_s) return 0;
    for (unsigned i = 0; i < self->sinusoids; i++) {
        const double phase = atan2(-self->fit[2 * i + 2], self->fit[2 * i + 1]), a = amplitude_of(self, i);
        const double turned = fabs(remainder(phase - self->mark[i], 2 * PI)) * self->memory_s / fmax(passed_s, self->memory_s), noise = 3 * deviation_of(self, i, cov) / a;
        const double half = self->mark_half_rad_s[i];
        self->mark[i] = phase;
        self->mark_half_rad_s[i] = self->half_rad_s[i];
        if (!self->marked || !(a > self->usual[i] / 3)) continue;
        self->drift_rad_s[i] = turned > noise ? 2 * turned / self->memory_s : 0;
        far |= self->usual[i] > 0 && turned > fmax(DRIFT, fmax(2 * noise, 3 * half * self->memory_s));
    }
    self->marked = 1;
    self->mark_ns = t_ns;
    return far;
}

/* The signal is there, for a memory and a half by now, and what is valid does not explain it. */
static int is_lost(tones *self, int64_t t_ns) {
    const double mean = self->share[1] / self->share[0];
    double least = INFINITY, unexplained = self->share[2] / self->share[0] - mean * mean - self->quiet;
    for (unsigned i = 0; i < self->sinusoids; i++) {
        least = fmin(least, self->usual[i] * self->usual[i] / 2);
        if (self->answer.valid_mask >> 2 * i & 1) unexplained -= amplitude_of(self, i) * amplitude_of(self, i) / 2;
    }
    if (!(least > 0) || unexplained < LOST * least) self->lost_ns = 0;
    else if (self->lost_ns == 0) self->lost_ns = t_ns;
    return self->lost_ns != 0 && 1e-9 * (double)(t_ns - self->lost_ns) > 1.5 * self->memory_s;
}

static void share_in(tones *self, double dt_s) {
    const double decay = exp(-dt_s / fmax(self->memory_s, MEMORY_LEAST)), y = self->y - self->origin;
    self->share[0] = decay * self->share[0] + 1;
    self->share[1] = decay * self->share[1] + y;
    self->share[2] = decay * self->share[2] + y * y;
}

static void put(driveid_estimate *a, unsigned i, double value, double half) {
    a->theta[i] = value;
    a->lo[i] = value - half;
    a->hi[i] = value + half;
    a->cov[i * (a->params + 1)] = half * half / (1.96 * 1.96);
}

/* Frequency and amplitude of one sinusoid; 1: it stands out. */
static int put_tone(tones *self, unsigned i, const double *cov) {
    const double amplitude = amplitude_of(self, i), deviation = sqrt(self->together) * deviation_of(self, i, cov);
    const double half = hypot(self->half_rad_s[i], self->drift_rad_s[i]), turned = half * self->memory_s; /* what a wrong frequency loses */
    const double spread = sqrt(1.96 * 1.96 * deviation * deviation + amplitude * amplitude * turned * turned * turned * turned);
    put(&self->answer, 2 * i, self->omega_rad_s[i] / (2 * PI), half / (2 * PI));
    put(&self->answer, 2 * i + 1, amplitude, isfinite(spread) ? spread : amplitude);
    return amplitude > STANDS_OUT * deviation && spread < 0.5 * amplitude && half < 0.5 * self->omega_rad_s[i];
}

/* Each parameter of the fit; the status of the answer. */
static driveid_status put_all(tones *self, const driveid_svf_common *common, const double *cov, int64_t t_ns) {
    driveid_estimate *a = &self->answer;
    const unsigned all = (1u << self->sinusoids) - 1;
    a->t_ns = t_ns;
    a->first_ns = common->answer.first_ns;
    a->samples = common->answer.samples;
    a->params = 2u * self->sinusoids;
    a->condition = common->answer.condition;
    const double errors = self->noise / self->judged;
    a->residual_rms = sqrt(errors);
    a->valid_mask = a->weak_mask = 0;
    memset(a->cov, 0, sizeof a->cov);
    for (unsigned i = 0; i < self->sinusoids; i++) {
        if (!put_tone(self, i, cov)) a->weak_mask |= 3u << 2 * i;
        else if ((common->answer.valid_mask & all) == all) {
            a->valid_mask |= 3u << 2 * i;
            self->usual[i] = amplitude_of(self, i);
        }
    }
    if (a->valid_mask + 1 < 1u << a->params) return DRIVEID_WEAK_EXCITATION;
    self->quiet += (self->quiet > 0 ? 0.02 : 1) * (errors - self->quiet);
    if (a->first_trusted_ns <= common->restart_ns) a->first_trusted_ns = t_ns;
    return DRIVEID_OK;
}

static void publish(tones *self, const driveid_svf_common *common, int64_t t_ns) {
    double cov[25];
    int turned = 0;
    self->answer.restarts = common->answer.restarts;
    if (common->status != DRIVEID_NOT_YET && fit(self, cov)) {
        turned = follow_phases(self, cov, t_ns);
        self->status = put_all(self, common, cov, t_ns);
    } else {
        self->answer.valid_mask = 0;
        self->status = DRIVEID_NOT_YET;
    }
    const int lost = is_lost(self, t_ns);
    self->changed = (uint8_t)(self->alarms && (turned || lost));
}

driveid_status tones_follow(tones *self, const driveid_svf_common *common, driveid_status status, int64_t t_ns, double y) {
    if (status < 0 || status == DRIVEID_DUPLICATE) return status;
    const int begins = common->segment_ns == t_ns; /* a start, a gap, an alarm */
    const double dt_s = begins ? 0 : 1e-9 * (double)(t_ns - self->last_ns);
    self->y = y;
    self->last_ns = t_ns;
    if (begins) {
        self->origin = y;
        self->lost_ns = 0;
        memset(self->share, 0, sizeof self->share);
        clear(self);
    }
    share_in(self, dt_s);
    if (common->status == DRIVEID_NOT_YET) self->known = 0;
    else if (common->answer.t_ns != self->omega_ns) renew(self, common);
    if (self->known) add(self, dt_s);
    if (t_ns - self->solve_ns >= common->solve_ns) {
        self->solve_ns = t_ns;
        publish(self, common, t_ns);
    }
    return status == DRIVEID_GAP ? status : self->status;
}

/* Counts may wrap: their differences do not. */
driveid_status tones_follow_count(tones *self, const driveid_svf_common *common, driveid_status status, int64_t t_ns, int32_t count) {
    const int32_t move = (int32_t)((uint32_t)count - (uint32_t)self->count);
    if (status < 0 || status == DRIVEID_DUPLICATE) return status;
    self->count = count;
    return tones_follow(self, common, status, t_ns, self->y + move * self->unit);
}

driveid_status tones_answer_of(const tones *self, driveid_estimate *out) {
    const int have = self->status == DRIVEID_OK || self->status == DRIVEID_WEAK_EXCITATION;
    if (have) *out = self->answer;
    return self->status;
}
