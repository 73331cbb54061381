/* SPDX-License-Identifier: Apache-2.0 */
/* Algebraic derivative method: the equation times t^n, integrated until no derivative is left.
 *
 * The n-th derivative in s kills the initial conditions; n + 1 divisions by s make it realisable. In time that is the weight
 * tau^n (t - tau)^n over everything since the start, kept by chains of integrators I^a[tau^b x]. They grow with t^(2n+1) and never forget, so
 * noise takes over after some ten seconds: the method is here to be compared with. It switches itself off after options.forgetting_s (10 s)
 * and holds its answer (DRIVEID_FROZEN); a gap or a restart begins anew. Its residual grows with it, so it has no alarm, and the interval
 * counts all rows as one. */
#ifndef DRIVEID_ESTIMATE_ADM_H
#define DRIVEID_ESTIMATE_ADM_H

#include "learn.h"

#include "base/real_f64.h"
#include "adm_decl.inc"
#include "base/real_f32.h"
#include "adm_decl.inc"

#endif
