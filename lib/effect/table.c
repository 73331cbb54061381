/* SPDX-License-Identifier: Apache-2.0 */
/* The catalogue: the one list of all effects, and access to it. */
#include <driveid/effect.h>

#include <string.h>

#define EFFECTS(X) \
    X(coulomb) X(stribeck) X(lugre) X(asymmetric_friction) X(load_dependent_friction) X(quadratic_drag) X(constant_load) \
    X(gravity_unbalance) X(cogging) X(torque_ripple) X(eccentric_friction) X(backlash) X(compliance) X(delay) \
    X(torque_saturation) X(resistance_drift) X(dead_time_voltage) X(current_offset) X(encoder_eccentricity) \
    X(inertia_change) X(friction_drift) X(hysteresis) X(dead_zone)

#define DECLARE(name) extern const driveid_effect_info driveid_effect_##name;
EFFECTS(DECLARE)

#define ENTRY(name) &driveid_effect_##name,
static const driveid_effect_info *const table[] = {EFFECTS(ENTRY)};
#define COUNT ((uint32_t)(sizeof table / sizeof table[0]))

uint32_t driveid_effect_count(void) { return COUNT; }

const driveid_effect_info *driveid_effect_at(uint32_t index) { return index < COUNT ? table[index] : NULL; }

const driveid_effect_info *driveid_effect_find(const char *name) {
    if (!name) return NULL;
    for (uint32_t k = 0; k < COUNT; k++)
        if (strcmp(name, table[k]->name) == 0) return table[k];
    return NULL;
}

driveid_status driveid_effect_columns(const driveid_effect_info *info, const double *shape, const driveid_effect_state *state, double *memory, double *column) {
    if (!info || !state || !column || !info->fill) return DRIVEID_ERR_ARGUMENT;
    if ((info->shapes && !shape) || (info->memory && !memory)) return DRIVEID_ERR_ARGUMENT;
    info->fill(shape, state, memory, column);
    return DRIVEID_OK;
}

driveid_status driveid_effect_publish(const driveid_effect_info *info, const double *shape, const double *linear, double gain, double *param) {
    if (!info || !param || !info->publish || (info->columns && !linear)) return DRIVEID_ERR_ARGUMENT;
    info->publish(shape, linear, gain, param);
    return DRIVEID_OK;
}

driveid_status driveid_effect_resolve(const driveid_effect_info *info, const double *param, double gain, double *shape, double *linear) {
    if (!info || !param || !info->resolve) return DRIVEID_ERR_ARGUMENT;
    info->resolve(param, gain, shape, linear);
    return DRIVEID_OK;
}
