/* SPDX-License-Identifier: Apache-2.0 */
#include "fleet_state.h"

#include "base/real_f32.h"
#include "fleet.inc"
