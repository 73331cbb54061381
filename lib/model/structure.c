/* SPDX-License-Identifier: Apache-2.0 */
#include "model/structure.h"

#include <string.h>

#define J {"J", "m", DRIVEID_DIM_INERTIA, NULL, NULL, 0}
#define B {"B", "b", DRIVEID_DIM_DAMPING, NULL, NULL, 0}
#define R {"R", NULL, DRIVEID_DIM_RESISTANCE, NULL, NULL, 0}
#define K_T {"K_t", NULL, DRIVEID_DIM_ONE, "Nm_A", "N m/A", 1}

static const driveid_structure_info table[DRIVEID_STRUCTURE_COUNT] = {
    [DRIVEID_STRUCTURE_RIGID_AXIS] = {"rigid_axis", 0, 1, 0, 3, {J, B, K_T}},
    [DRIVEID_STRUCTURE_LINEAR_AXIS] = {"linear_axis", 1, 1, 0, 3, {J, B, {"K_F", NULL, DRIVEID_DIM_ONE, "N_A", "N/A", 1}}},
    [DRIVEID_STRUCTURE_TWO_MASS_AXIS] = {"two_mass_axis", 0, 1, 0, 6,
        {{"J_m", NULL, DRIVEID_DIM_INERTIA, NULL, NULL, 0}, {"J_l", NULL, DRIVEID_DIM_INERTIA, NULL, NULL, 0},
         {"k", NULL, DRIVEID_DIM_STIFFNESS, NULL, NULL, 0}, {"d", NULL, DRIVEID_DIM_DAMPING, NULL, NULL, 0}, B, K_T}},
    [DRIVEID_STRUCTURE_DC_CIRCUIT] = {"dc_circuit", 0, 0, 1, 3,
        {R, {"L", NULL, DRIVEID_DIM_ONE, "H", "H", 0}, {"K_e", NULL, DRIVEID_DIM_ONE, "Vs_rad", "V s/rad", 0}}},
    [DRIVEID_STRUCTURE_DC_DRIVE] = {"dc_drive", 0, 1, 1, 6,
        {J, B, R, {"L", NULL, DRIVEID_DIM_ONE, "H", "H", 0}, {"K_e", NULL, DRIVEID_DIM_ONE, "Vs_rad", "V s/rad", 0}, K_T}},
    [DRIVEID_STRUCTURE_PMSM_DRIVE] = {"pmsm_drive", 0, 1, 1, 7,
        {R, {"L_d", NULL, DRIVEID_DIM_ONE, "H", "H", 0}, {"L_q", NULL, DRIVEID_DIM_ONE, "H", "H", 0},
         {"psi_pm", NULL, DRIVEID_DIM_ONE, "Vs", "V s", 0}, J, B, {"pole_pairs", NULL, DRIVEID_DIM_ONE, "", "1", 1}}},
    [DRIVEID_STRUCTURE_LTI] = {"lti", 0, 0, 0, 0, {{0}}}, /* y'' + a_1 y' + a_0 y = b_0 u unless other orders are given */
};

const driveid_structure_info *driveid_structure_get(driveid_structure structure) {
    return (unsigned)structure < DRIVEID_STRUCTURE_COUNT ? &table[structure] : NULL;
}

const char *driveid_structure_name(driveid_structure structure) {
    const driveid_structure_info *info = driveid_structure_get(structure);
    return info ? info->name : NULL;
}

driveid_status driveid_structure_from_name(const char *name, driveid_structure *structure) {
    if (!name || !structure) return DRIVEID_ERR_ARGUMENT;
    for (unsigned s = 0; s < DRIVEID_STRUCTURE_COUNT; s++)
        if (strcmp(name, table[s].name) == 0) {
            *structure = (driveid_structure)s;
            return DRIVEID_OK;
        }
    return DRIVEID_ERR_ARGUMENT;
}
