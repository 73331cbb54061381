/* SPDX-License-Identifier: Apache-2.0 */
/* Private to the simulation: one substep of each part. */
#ifndef DRIVEID_MODEL_SIM_H
#define DRIVEID_MODEL_SIM_H

#include <driveid/simulate.h>

/* Mean of a channel over [from_s, to_s] under its hold. *hint: row near from_s, kept between calls. */
double driveid_sim_mean(const driveid_sim_record *record, const double *channel, driveid_hold hold, double from_s, double to_s, size_t *hint);

/* Axis over h seconds with driving channel `drive` (mean over the substep). at: t_s, T_degC, has_temperature, voltage filled. */
void driveid_sim_axis_step(const driveid_sim *sim, driveid_sim_state *state, driveid_effect_state *at, double h, double drive);

/* Winding over h seconds with terminal voltage v and speed (mean over the substep). */
void driveid_sim_circuit_step(const driveid_sim *sim, driveid_sim_state *state, driveid_effect_state *at, double h, double v, double speed);
void driveid_sim_dq_step(const driveid_sim *sim, driveid_sim_state *state, driveid_effect_state *at, double h, double v_d, double v_q, double speed);

/* lti over one sample: exact for the hold. u0, u1: input at both ends (equal where it is held). */
void driveid_sim_lti_step(const driveid_sim *sim, double *x, double h, double u0, double u1);
double driveid_sim_lti_output(const driveid_sim *sim, const double *x, double u);

#endif
