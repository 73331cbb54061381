/* SPDX-License-Identifier: Apache-2.0 */
#include <driveid/excitation.h>

#include <math.h>
#include <stddef.h>

enum { STATES = 6 }; /* x, its derivative by w0, by zeta, and their rates */

static int sound(const driveid_excitation *s) {
    return s && s->omega_0_rad_s > 0 && s->zeta >= 0 && s->zeta <= 1 && s->amplitude > 0 && s->sigma >= 0 && s->dt_s > 0 && s->span_s > 4 * s->dt_s &&
           s->span_s <= 1e6 * s->dt_s;
}

static void rates(const driveid_excitation *s, double ratio, double t, const double *x, double *out) {
    const double w = s->omega_0_rad_s, z = s->zeta;
    for (int i = 0; i < 3; i++) {
        out[i] = x[3 + i];
        out[3 + i] = -2 * z * w * x[3 + i] - w * w * x[i];
    }
    out[3] += s->amplitude * sin(ratio * w * t);
    out[4] -= 2 * z * x[3] + 2 * w * x[0];
    out[5] -= 2 * w * x[3];
}

static void runge_kutta(const driveid_excitation *s, double ratio, double t, double h, double *x) {
    static const double at[4] = {0, 0.5, 0.5, 1}, share[4] = {1.0 / 6, 1.0 / 3, 1.0 / 3, 1.0 / 6};
    double k[STATES] = {0}, sum[STATES] = {0}, y[STATES];
    for (int r = 0; r < 4; r++) {
        for (int i = 0; i < STATES; i++) y[i] = x[i] + at[r] * h * k[i];
        rates(s, ratio, t + at[r] * h, y, k);
        for (int i = 0; i < STATES; i++) sum[i] += share[r] * k[i];
    }
    for (int i = 0; i < STATES; i++) x[i] += h * sum[i];
}

driveid_status driveid_excitation_bound(const driveid_excitation *s, double ratio, double *omega_0, double *zeta) {
    if (!sound(s) || !(ratio > 0) || !omega_0 || !zeta) return DRIVEID_ERR_ARGUMENT;
    double x[STATES] = {0}, ww = 0, wz = 0, zz = 0;
    const int steps = 1 + (int)(s->omega_0_rad_s * fmax(1, ratio) * s->dt_s / 0.2); /* a sample */
    for (double t = 0; t < s->span_s; t += s->dt_s) {
        for (int i = 0; i < steps; i++) runge_kutta(s, ratio, t + i * s->dt_s / steps, s->dt_s / steps, x);
        ww += x[1] * x[1];
        wz += x[1] * x[2];
        zz += x[2] * x[2];
    }
    const double left_w = ww - wz * wz / zz, left_z = zz - wz * wz / ww;
    if (!(left_w > 0) || !(left_z > 0)) return DRIVEID_ERR_ARGUMENT;
    *omega_0 = s->sigma / sqrt(left_w) / s->omega_0_rad_s;
    *zeta = s->sigma / sqrt(left_z) / fmax(s->zeta, 1e-12);
    return DRIVEID_OK;
}

driveid_status driveid_excitation_variance(const driveid_excitation *s, double ratio, double lambda, double *variance) {
    if (!sound(s) || !(ratio > 0) || !(lambda > 0 && lambda <= 1) || !variance) return DRIVEID_ERR_ARGUMENT;
    const double w = s->omega_0_rad_s, near = fabs(ratio - 1) < 1e-6 ? 1 + 1e-6 : ratio; /* the limit is smooth */
    double above = 0, below = 0;
    for (double t = s->dt_s; t <= s->span_s * (1 + 1e-12); t += s->dt_s) {
        const double x = (near * sin(w * t) - sin(near * w * t)) / (w * w * (near * near - 1)); /* per unit of amplitude, (8) */
        above = lambda * lambda * above + x * x;
        below = lambda * below + x * x;
    }
    if (!(below > 0)) return DRIVEID_ERR_ARGUMENT;
    *variance = s->sigma * s->sigma / (s->amplitude * s->amplitude) * above / (below * below);
    return DRIVEID_OK;
}

driveid_status driveid_excitation_suggest(const driveid_excitation *s, double *ratio, double *omega_0) {
    if (!sound(s) || !ratio || !omega_0) return DRIVEID_ERR_ARGUMENT;
    double best = INFINITY, at = 1, step = pow(10, 0.05);
    for (int turn = 0; turn < 3; turn++, step = pow(step, 0.2)) { /* a decade either side, then ever closer */
        const double centre = at;
        for (int i = -20; i <= 20; i++) {
            double bound, other;
            const double z = centre * pow(step, i);
            if (driveid_excitation_bound(s, z, &bound, &other) || !(bound < best)) continue;
            best = bound;
            at = z;
        }
    }
    if (!isfinite(best)) return DRIVEID_ERR_ARGUMENT;
    *ratio = at;
    *omega_0 = best;
    return DRIVEID_OK;
}
