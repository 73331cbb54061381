/* SPDX-License-Identifier: Apache-2.0 */
/* Private to lib/effect: small pieces that several effects share. */
#ifndef DRIVEID_EFFECT_INTERNAL_H
#define DRIVEID_EFFECT_INTERNAL_H

#include <driveid/effect.h>

#include <math.h>

#define DRIVEID_PI 3.14159265358979323846

/* a sin(x) + b cos(x) = amplitude * sin(x + phase) */
static inline void driveid_polar(double a, double b, double *amplitude, double *phase) {
    *amplitude = hypot(a, b);
    *phase = (a == 0.0 && b == 0.0) ? 0.0 : atan2(b, a);
}

/* One linear parameter that is published as it is. */
void driveid_publish_plain(const double *shape, const double *linear, double gain, double *param);
void driveid_resolve_plain(const double *param, double gain, double *shape, double *linear);

/* One linear parameter, published as it is, then one shape parameter. */
void driveid_publish_shaped(const double *shape, const double *linear, double gain, double *param);
void driveid_resolve_shaped(const double *param, double gain, double *shape, double *linear);

/* A wave over the angle: order (shape), then amplitude and phase of a sine and a cosine (linear). */
void driveid_publish_wave(const double *shape, const double *linear, double gain, double *param);
void driveid_resolve_wave(const double *param, double gain, double *shape, double *linear);

/* Friction level relative to Coulomb's: 1 at speed, s at rest [Stribeck]. */
static inline double driveid_stribeck_level(double speed, double omega_s, double s) {
    const double x = speed / omega_s;
    return 1.0 + (s - 1.0) * exp(-x * x);
}

/* Advance a bristle (Dahl, LuGre) in units of its Coulomb deflection over dt at constant speed, exactly:
 * zeta' = (speed/length) (1 - zeta sign(speed)/level). Returns zeta' at the new instant. */
double driveid_bristle_step(double *zeta, double speed, double level, double length, double dt_s);

#endif
