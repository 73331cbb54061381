/* SPDX-License-Identifier: Apache-2.0 */
/* The part of the configuration that does not depend on the number type. */
#ifndef DRIVEID_ESTIMATE_FSM_CONFIG_H
#define DRIVEID_ESTIMATE_FSM_CONFIG_H

#include "fsm_state.h"

/* Numbers in the pool: an equation's sums S of all stages and its scratch for a solve; one stage's open row, history of coarse rows, lagged sums. */
uint32_t fsm_equation_size(const fsm_equation *equation);
uint32_t fsm_stage_size(const fsm_equation *equation);
uint32_t fsm_pool_used(const driveid_svf_common *common);

/* Checks, resolves defaults, splits the terms by equation; level[channels] says where a channel's own value counts. */
driveid_status fsm_configure_common(driveid_svf_common *common, const driveid_regression *regression,
                                    const driveid_estimator_options *options, uint8_t *level, char *reason, size_t reason_size);

/* The answer as the caller gets it; driveid_estimate says when it is written. */
driveid_status fsm_answer_of(const driveid_svf_common *common, driveid_estimate *out);

#endif
