/* SPDX-License-Identifier: Apache-2.0 */
#include "shifting.h"

#include "base/real_f64.h"
#include "shifting.inc"
