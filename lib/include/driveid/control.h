/* SPDX-License-Identifier: Apache-2.0 */
/* A speed controller for an identified transfer function: notch filters and a PI term by loop shaping, margins, closed-loop step.
 *
 * Purpose   what a user does next with the model of lti.h, and the control application of Fliess et al. 2006 (section VI.B).
 * Form      in the Tustin plane q = (2/T)(z-1)/(z+1): R(q) = gain (1 + q/zero)/q * prod (1 + 2 zeta_from q/w + (q/w)^2) / (1 + 2 zeta_to q/w + (q/w)^2).
 *           The plant is the zero-order-hold equivalent of the model at T_s with its delay, so what is computed is the sampled loop itself.
 * Frequency is Omega = (2/T) tan(omega T/2) of that plane; well below 1/T_s the two agree.
 * Memory    allocates while it runs; thread-safe. */
#ifndef DRIVEID_CONTROL_H
#define DRIVEID_CONTROL_H

#include <driveid/lti.h>

#ifdef __cplusplus
extern "C" {
#endif

#define DRIVEID_NOTCH_MAX 4

typedef struct driveid_notch {
    double omega_rad_s;
    double zeta_from; /* damping that is compensated; 1.5 times that of the pole pair is robust, 1 times is exact */
    double zeta_to;   /* damping put in its place, (0, 1] */
} driveid_notch;

typedef struct driveid_controller {
    double T_s;
    double gain;       /* 1/s, per unit of plant gain; its sign is that of the plant */
    double zero_rad_s; /* of the PI term; 0: integral action alone */
    size_t notches;
    driveid_notch notch[DRIVEID_NOTCH_MAX];
} driveid_controller;

typedef struct driveid_loop_wish {
    double T_s;
    double phase_margin_deg;   /* 20 .. 85; 60 is usual */
    double crossover_rad_s;    /* Omega_c; 0: the fastest that keeps the phase margin and a gain margin of 6 dB */
    double notch_below_zeta;   /* pole pairs with less damping get a notch; 0: 0.3 */
    double notch_widen;        /* zeta_from over the pair's damping; 0: 1.5 */
} driveid_loop_wish;

typedef struct driveid_loop_margins {
    double crossover_rad_s, phase_margin_deg; /* at the highest frequency with |L| = 1; NaN where there is none */
    double phase_crossover_rad_s, gain_margin_db; /* smallest over all phase crossings with |L| < 1; infinite where there is none */
    int stable;                                /* all closed-loop poles inside the unit circle */
} driveid_loop_margins;

typedef struct driveid_step_figures {
    double t90_s;             /* NaN where the record is too short to tell */
    double overshoot_percent;
    double settling_s;        /* last time outside 2 % of the final value; NaN likewise */
} driveid_step_figures;

/* DRIVEID_OK; DRIVEID_ERR_ARGUMENT; DRIVEID_ERR_DATA where no controller of this form reaches the wish (asked crossover too fast for the phase margin; zero plant gain);
 * `reachable` (may be NULL) then has the largest phase margin in degrees at the asked crossover. */
driveid_status driveid_loop_design(const driveid_lti_model *plant, const driveid_loop_wish *wish, driveid_controller *controller, double *reachable_deg);

/* Open loop L = R G at Omega[count]. */
driveid_status driveid_loop_frequency(const driveid_lti_model *plant, const driveid_controller *controller, size_t count, const double *Omega_rad_s, double *re, double *im);

driveid_status driveid_loop_margins_of(const driveid_lti_model *plant, const driveid_controller *controller, driveid_loop_margins *margins);

/* Output y[count], sample by sample, for a unit step of the reference at the first one; figures may be NULL. */
driveid_status driveid_loop_step(const driveid_lti_model *plant, const driveid_controller *controller, size_t count, double *y, driveid_step_figures *figures);

/* The controller as difference equation sections: section[k] = {b0, b1, b2, a1, a2}, u_k = b0 e_k + b1 e_(k-1) + b2 e_(k-2) - a1 u_(k-1) - a2 u_(k-2); the first one is
 * the PI term. section[1 + notches][5]. */
driveid_status driveid_controller_sections(const driveid_controller *controller, double (*section)[5]);

#ifdef __cplusplus
}
#endif
#endif
