/* SPDX-License-Identifier: Apache-2.0 */
#include "kernel.h"

#include "base/real_f64.h"
#include "kernel.inc"
