/* SPDX-License-Identifier: Apache-2.0 */
/* Private: the table of structures. */
#ifndef DRIVEID_MODEL_STRUCTURE_H
#define DRIVEID_MODEL_STRUCTURE_H

#include <driveid/effect.h>
#include <driveid/model.h>

typedef struct driveid_structure_param {
    const char *symbol, *symbol_linear;
    driveid_dimension dimension;
    const char *suffix, *unit;   /* where the dimension does not say it (henry, weber): fixed; else NULL */
    uint8_t only_given;          /* appears only once it is given */
} driveid_structure_param;

typedef struct driveid_structure_info {
    const char *name;
    uint8_t linear, mechanical, electrical;
    uint8_t params;
    driveid_structure_param param[8];
} driveid_structure_info;

const driveid_structure_info *driveid_structure_get(driveid_structure structure);

#endif
