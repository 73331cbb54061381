/* SPDX-License-Identifier: Apache-2.0 */
#include "recursive.h"

#include "base/real_f32.h"
#include "recursive.inc"
#include "rls.inc"
#include "kalman.inc"
