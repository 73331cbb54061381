/* SPDX-License-Identifier: Apache-2.0 */
/* Many drives in one call: the frequency-shifting estimator of estimate.h for drives that share equations, options and sampling instants.
 *
 * Purpose   a gateway with hundreds of drives on one cycle. What a drive gets is what driveid_estimator "fsm" gives it alone, bit by bit.
 * Model     as in estimate.h, the same regression and options for every drive.
 * Method    the filter bank, which runs at every sample, keeps its states of eight drives side by side, so that the compiler's vectors step them together; rows,
 *           sums and answers, at their slower rates, are the single estimator's own. A drive that falls out of step (a value that is no number, a gap, an
 *           alarm, a restart) runs on its own until its stamps agree with the others' again.
 * Parameters  f64 or f32. Storage is the caller's, 8-byte aligned, no self-pointers: a copy is a snapshot.
 * Returns   update: DRIVEID_OK and one status a drive as of driveid_estimator_update; DRIVEID_ERR_ARGUMENT. configure: as of driveid_estimator_configure.
 * Cost      docs/benchmark-estimator.md; a rigid axis takes about 35 kB of storage. Stack as the single estimator's.
 * Accuracy  tests/unit/fleet_test.cpp: bits equal to single estimators through gaps, lost values, alarms and restarts. */
#ifndef DRIVEID_FLEET_H
#define DRIVEID_FLEET_H

#include <driveid/estimate.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct driveid_fleet driveid_fleet;

/* Bytes needed; 0 where configure would refuse. */
size_t driveid_fleet_size(driveid_real type, const driveid_regression *regression, const driveid_estimator_options *options, uint32_t drives);
driveid_status driveid_fleet_configure(driveid_fleet *self, size_t size, driveid_real type, const driveid_regression *regression,
                                       const driveid_estimator_options *options, uint32_t drives, char *reason, size_t reason_size);
/* channel[regression.channels][drives], SI; status[drives]. */
driveid_status driveid_fleet_update(driveid_fleet *self, int64_t t_ns, const double *channel, driveid_status *status);
driveid_status driveid_fleet_estimate(const driveid_fleet *self, uint32_t drive, driveid_estimate *out);
void driveid_fleet_gap(driveid_fleet *self, uint32_t drive);
void driveid_fleet_restart(driveid_fleet *self, uint32_t drive);

#ifdef __cplusplus
}
#endif
#endif
