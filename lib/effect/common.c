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

double driveid_bristle_step(double *zeta, double speed, double level, double length, double dt_s) {
    const double rate = fabs(speed) / (length * level);
    const double end = speed >= 0.0 ? level : -level;
    if (rate > 0.0 && dt_s > 0.0) *zeta = end + (*zeta - end) * exp(-rate * dt_s);
    return speed / length - rate * *zeta;
}
