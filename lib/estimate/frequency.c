/* SPDX-License-Identifier: Apache-2.0 */
#include <driveid/frequency.h>

#include <math.h>
#include <string.h>

driveid_status driveid_frequency_regression(uint32_t sinusoids, double omega_rad_s, driveid_regression *out) {
    if (!out || sinusoids < 1 || sinusoids > 2 || !(omega_rad_s >= 0) || !isfinite(omega_rad_s)) return DRIVEID_ERR_ARGUMENT;
    memset(out, 0, sizeof *out);
    out->equations = out->channels = 1;
    out->params = (uint8_t)sinusoids;
    out->terms = (uint8_t)(sinusoids + 1);
    out->bandwidth_rad_s = 5 * omega_rad_s;
    const uint8_t top = (uint8_t)(2 * sinusoids + 1);
    out->term[0] = (driveid_term){0, 0, top, DRIVEID_TERM_KNOWN, 1};
    for (uint8_t i = 0; i < sinusoids; i++) out->term[i + 1] = (driveid_term){0, 0, (uint8_t)(top - 2 - 2 * i), (int8_t)i, 1};
    return DRIVEID_OK;
}

/* One frequency from its square, with the square's standard deviation. */
static void put(driveid_frequency *f, unsigned i, double square, double deviation) {
    const double omega = sqrt(square), half = 1.96 * deviation / (2 * omega);
    f->omega_rad_s[i] = omega;
    f->lo_rad_s[i] = omega - half;
    f->hi_rad_s[i] = omega + half;
}

/* The method's half-width over 1.96 carries the few degrees of freedom at the start. */
static double widen(const driveid_estimate *e, unsigned i) {
    const double own = sqrt(fmax(0, e->cov[i * (e->params + 1)]));
    return own > 0 ? (e->hi[i] - e->lo[i]) / (2 * 1.96 * own) : 1;
}

driveid_status driveid_frequency_read(const driveid_estimate *e, driveid_frequency *out) {
    driveid_frequency f = {0};
    if (!e || !out || e->params < 1 || e->params > 2) return DRIVEID_ERR_ARGUMENT;
    f.sinusoids = e->params;
    if (e->params == 1) {
        if (!(e->theta[0] > 0)) return DRIVEID_RANK;
        put(&f, 0, e->theta[0], widen(e, 0) * sqrt(fmax(0, e->cov[0])));
    } else { /* w^2 = x: x^2 - theta0 x + theta1 = 0, dx = (x dtheta0 - dtheta1) / (2 x - theta0) */
        const double middle = e->theta[0] / 2, root = sqrt(fmax(0, middle * middle - e->theta[1]));
        if (!(root > 0) || !(middle - root > 0)) return DRIVEID_RANK;
        for (unsigned i = 0; i < 2; i++) {
            const double x = i ? middle + root : middle - root;
            const double variance = x * x * e->cov[0] - 2 * x * e->cov[1] + e->cov[3];
            put(&f, i, x, fmax(widen(e, 0), widen(e, 1)) * sqrt(fmax(0, variance)) / (2 * root));
        }
    }
    *out = f;
    return DRIVEID_OK;
}
