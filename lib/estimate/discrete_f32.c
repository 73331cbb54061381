/* SPDX-License-Identifier: Apache-2.0 */
#include "discrete_common.h"

#include "base/real_f32.h"
#include "discrete.inc"
