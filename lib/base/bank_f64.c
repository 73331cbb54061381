/* SPDX-License-Identifier: Apache-2.0 */
#include "bank.h"

#include "real_f64.h"
#include "bank.inc"
