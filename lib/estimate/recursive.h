/* SPDX-License-Identifier: Apache-2.0 */
/* State of the two recursive baselines (rls.inc, kalman.inc): rows from the invariant filter bank, theta and its covariance row by row. */
#ifndef DRIVEID_ESTIMATE_RECURSIVE_H
#define DRIVEID_ESTIMATE_RECURSIVE_H

#include "learn.h"

#define RECURSIVE_SETTLED 20.0 /* times 1/bandwidth: the filters have forgotten the initial conditions to 1e-5 */
#define RECURSIVE_WIDE 1e3     /* prior deviation of a parameter, relative to what its column's first rows give */

#include "base/real_f64.h"
#include "recursive_decl.inc"
#include "base/real_f32.h"
#include "recursive_decl.inc"

#endif
