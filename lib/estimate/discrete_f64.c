/* SPDX-License-Identifier: Apache-2.0 */
#include "discrete_common.h"

#include "base/real_f64.h"
#include "discrete.inc"
