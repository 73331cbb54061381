/* SPDX-License-Identifier: Apache-2.0 */
#include "kernel.h"

#include "base/real_f32.h"
#include "kernel.inc"
