/* SPDX-License-Identifier: Apache-2.0 */
/* The part of the configuration that does not depend on the number type. */
#ifndef DRIVEID_ESTIMATE_FSM_CONFIG_H
#define DRIVEID_ESTIMATE_FSM_CONFIG_H

#include "fsm_state.h"

/* Numbers that one stage of an equation with so many columns needs in the pool. */
uint32_t fsm_block_size(unsigned columns);

/* Checks, resolves defaults, splits the terms by equation; level[channels] says where a channel's own value counts. */
driveid_status fsm_configure_common(driveid_svf_common *common, const driveid_regression *regression,
                                    const driveid_estimator_options *options, uint8_t *level, char *reason, size_t reason_size);

#endif
