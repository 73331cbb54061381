/* SPDX-License-Identifier: Apache-2.0 */
/* Names and units of parameters: symbol and dimension, in the frame of the model. */
#include <driveid/effect.h>

#include <stdio.h>

typedef struct { const char *suffix[DRIVEID_FRAME_COUNT], *unit[DRIVEID_FRAME_COUNT]; } row;

static const row mechanical[] = {
    [DRIVEID_DIM_FORCE] = {{"Nm", "N", "A", "A", "V"}, {"N m", "N", "A", "A", "V"}},
    [DRIVEID_DIM_DAMPING] = {{"Nms_rad", "Ns_m", "As_rad", "As_m", "Vs_rad"}, {"N m s/rad", "N s/m", "A s/rad", "A s/m", "V s/rad"}},
    [DRIVEID_DIM_DRAG] = {{"Nms2_rad2", "Ns2_m2", "As2_rad2", "As2_m2", "Vs2_rad2"}, {"N m s^2/rad^2", "N s^2/m^2", "A s^2/rad^2", "A s^2/m^2", "V s^2/rad^2"}},
    [DRIVEID_DIM_STIFFNESS] = {{"Nm_rad", "N_m", "A_rad", "A_m", "V_rad"}, {"N m/rad", "N/m", "A/rad", "A/m", "V/rad"}},
    [DRIVEID_DIM_INERTIA] = {{"kgm2", "kg", "As2_rad", "As2_m", "Vs2_rad"}, {"kg m^2", "kg", "A s^2/rad", "A s^2/m", "V s^2/rad"}},
    [DRIVEID_DIM_SPEED] = {{"rad_s", "m_s", "rad_s", "m_s", "rad_s"}, {"rad/s", "m/s", "rad/s", "m/s", "rad/s"}},
    [DRIVEID_DIM_LENGTH] = {{"rad", "m", "rad", "m", "rad"}, {"rad", "m", "rad", "m", "rad"}},
    [DRIVEID_DIM_ORDER] = {{"", "rad_m", "", "rad_m", ""}, {"1", "rad/m", "1", "rad/m", "1"}},
};

static int is_linear(driveid_frame frame) { return frame == DRIVEID_FRAME_FORCE || frame == DRIVEID_FRAME_AMPERE_LINEAR; }

static const char *drive_text(driveid_frame frame, char drive_unit, int unit) {
    if (drive_unit == 'A') return "A";
    if (drive_unit == 'V') return "V";
    if (is_linear(frame)) return "N";
    return unit ? "N m" : "Nm";
}

static const char *text(driveid_dimension dimension, driveid_frame frame, char drive_unit, int unit) {
    if ((unsigned)frame >= DRIVEID_FRAME_COUNT) return "";
    switch (dimension) {
    case DRIVEID_DIM_ONE: return unit ? "1" : "";
    case DRIVEID_DIM_PHASE: return "rad";
    case DRIVEID_DIM_DRIVE: return drive_text(frame, drive_unit, unit);
    case DRIVEID_DIM_CURRENT: return "A";
    case DRIVEID_DIM_VOLTAGE: return "V";
    case DRIVEID_DIM_RESISTANCE: return "ohm";
    case DRIVEID_DIM_TIME: return "s";
    default: break;
    }
    return unit ? mechanical[dimension].unit[frame] : mechanical[dimension].suffix[frame];
}

const char *driveid_dimension_suffix(driveid_dimension dimension, driveid_frame frame, char drive_unit) {
    return text(dimension, frame, drive_unit, 0);
}

const char *driveid_dimension_unit(driveid_dimension dimension, driveid_frame frame, char drive_unit) {
    return text(dimension, frame, drive_unit, 1);
}

driveid_status driveid_effect_param_name(const driveid_effect_info *info, uint32_t k, driveid_frame frame, char drive_unit, char *buffer, size_t buffer_size) {
    if (!info || k >= info->params || !buffer || (unsigned)frame >= DRIVEID_FRAME_COUNT) return DRIVEID_ERR_ARGUMENT;
    const driveid_effect_param *p = &info->param[k];
    const char *symbol = is_linear(frame) && p->symbol_linear ? p->symbol_linear : p->symbol;
    const char *suffix = driveid_dimension_suffix(p->dimension, frame, drive_unit);
    snprintf(buffer, buffer_size, "%s%s%s", symbol, suffix[0] ? "_" : "", suffix);
    return DRIVEID_OK;
}

driveid_status driveid_effect_param_unit(const driveid_effect_info *info, uint32_t k, driveid_frame frame, char drive_unit, char *buffer, size_t buffer_size) {
    if (!info || k >= info->params || !buffer || (unsigned)frame >= DRIVEID_FRAME_COUNT) return DRIVEID_ERR_ARGUMENT;
    snprintf(buffer, buffer_size, "%s", driveid_dimension_unit(info->param[k].dimension, frame, drive_unit));
    return DRIVEID_OK;
}
