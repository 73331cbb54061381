/* SPDX-License-Identifier: Apache-2.0 */
/* A fleet's storage: head, what is looked at of each drive at every sample, lanes of filter states, one estimator a drive cut after what it uses. */
#ifndef DRIVEID_ESTIMATE_FLEET_STATE_H
#define DRIVEID_ESTIMATE_FLEET_STATE_H

#include <driveid/fleet.h>

#include "fsm_state.h"

#define FLEET_LANES 8

struct driveid_fleet {
    uint32_t type, drives;
    uint64_t glance_at, lanes_at, lane_bytes, drive_at, drive_bytes; /* places in the storage, from its begin */
    uint64_t bytes;
    int64_t last_ns, step_ns;   /* of the drives in step */
    int64_t row_ns, gap_ns;
    uint32_t started;
};

typedef struct fleet_glance {
    int64_t last_row_ns;
    uint32_t samples;           /* taken in the lanes and not yet counted by the drive */
    int8_t status;
    uint8_t alone;              /* its filters are its own, not in the lanes */
    uint8_t impulse_live, gap_told;
} fleet_glance;

#include "base/real_f64.h"
#include "fleet_decl.inc"
#include "base/real_f32.h"
#include "fleet_decl.inc"

#endif
