/* SPDX-License-Identifier: Apache-2.0 */
#ifndef DRIVEID_TARGET_CHECKS_H
#define DRIVEID_TARGET_CHECKS_H

#ifdef RUN_INSTALLED
#include <driveid/estimate.h>
#else
#include "driveid.h"
#endif

#ifdef __cplusplus
extern "C" {
#endif

#define CHECKS_SHIFT 64 /* a snapshot is moved so far: storage holds this beside the estimator */

/* NULL beyond the last. */
const char *checks_name(unsigned index);
/* 0, or the line of checks.c that does not hold. */
int checks_run(unsigned index, const char *method, driveid_real type);

#ifdef __cplusplus
}
#endif
#endif
