/* SPDX-License-Identifier: Apache-2.0 */
#include "fsm_state.h"

#include "base/real_f32.h"
#include "fsm.inc"
#include "fsm_rows.inc"
#include "fsm_answer.inc"
