/* SPDX-License-Identifier: Apache-2.0 */
#include "fleet_state.h"

#include "base/real_f64.h"
#include "fleet.inc"
