/* SPDX-License-Identifier: Apache-2.0 */
#include "effect/internal.h"

void driveid_publish_plain(const double *shape, const double *linear, double gain, double *param) {
    (void)shape;
    (void)gain;
    param[0] = linear[0];
}

void driveid_resolve_plain(const double *param, double gain, double *shape, double *linear) {
    (void)shape;
    (void)gain;
    linear[0] = param[0];
}

void driveid_publish_shaped(const double *shape, const double *linear, double gain, double *param) {
    (void)gain;
    param[0] = linear[0];
    param[1] = shape[0];
}

void driveid_resolve_shaped(const double *param, double gain, double *shape, double *linear) {
    (void)gain;
    linear[0] = param[0];
    shape[0] = param[1];
}

void driveid_publish_wave(const double *shape, const double *linear, double gain, double *param) {
    (void)gain;
    param[0] = shape[0];
    driveid_polar(linear[0], linear[1], &param[1], &param[2]);
}

void driveid_resolve_wave(const double *param, double gain, double *shape, double *linear) {
    (void)gain;
    shape[0] = param[0];
    linear[0] = param[1] * cos(param[2]);
    linear[1] = param[1] * sin(param[2]);
}

double driveid_bristle_step(double *zeta, double speed, double level, double length, double dt_s) {
    const double rate = fabs(speed) / (length * level);
    const double end = speed >= 0.0 ? level : -level;
    if (rate > 0.0 && dt_s > 0.0) *zeta = end + (*zeta - end) * exp(-rate * dt_s);
    return speed / length - rate * *zeta;
}
