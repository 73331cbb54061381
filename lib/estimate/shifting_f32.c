/* SPDX-License-Identifier: Apache-2.0 */
#include "shifting.h"

#include "base/real_f32.h"
#include "shifting.inc"
