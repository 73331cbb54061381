/* SPDX-License-Identifier: Apache-2.0 */
#include "adm.h"

#include "base/real_f64.h"
#include "adm.inc"
