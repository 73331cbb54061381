/* SPDX-License-Identifier: Apache-2.0 */
/* Signals and samples: SI values of one drive at one instant.
 *
 * A signal's name carries symbol and SI unit and is the same in C, in configuration and model files, in records,
 * in JSON and in Python. driveid_signal_from_name() and driveid_signal_name() convert. */
#ifndef DRIVEID_SAMPLE_H
#define DRIVEID_SAMPLE_H

#include <stdint.h>

#include <driveid/status.h>
#include <driveid/time.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum driveid_signal {
    DRIVEID_SIGNAL_I_A = 0,      /* i_A         armature or line current */
    DRIVEID_SIGNAL_I_D_A,        /* i_d_A */
    DRIVEID_SIGNAL_I_Q_A,        /* i_q_A */
    DRIVEID_SIGNAL_V_V,          /* v_V         armature voltage */
    DRIVEID_SIGNAL_V_D_V,        /* v_d_V */
    DRIVEID_SIGNAL_V_Q_V,        /* v_q_V */
    DRIVEID_SIGNAL_TAU_NM,       /* tau_Nm      measured torque */
    DRIVEID_SIGNAL_F_N,          /* F_N         measured force (linear axis) */
    DRIVEID_SIGNAL_THETA_RAD,    /* theta_rad   motor angle, unwrapped */
    DRIVEID_SIGNAL_OMEGA_RAD_S,  /* omega_rad_s motor speed */
    DRIVEID_SIGNAL_THETA_L_RAD,  /* theta_l_rad load angle (two masses) */
    DRIVEID_SIGNAL_OMEGA_L_RAD_S,/* omega_l_rad_s */
    DRIVEID_SIGNAL_X_M,          /* x_m         position (linear axis) */
    DRIVEID_SIGNAL_V_M_S,        /* v_m_s       speed (linear axis) */
    DRIVEID_SIGNAL_T_DEGC,       /* T_degC      temperature */
    DRIVEID_SIGNAL_U,            /* u           input of an lti structure */
    DRIVEID_SIGNAL_Y,            /* y           output of an lti structure */
    DRIVEID_SIGNAL_COUNT
} driveid_signal;

/* How a channel behaves between two stamps: it decides the exact hold of the filter bank. */
typedef enum driveid_hold {
    DRIVEID_HOLD_FIRST = 0, /* smooth between stamps (an encoder, a measured current): a parabola through the last three */
    DRIVEID_HOLD_ZERO = 1,  /* constant from its stamp to the next (a drive's command) */
    DRIVEID_HOLD_AVERAGE = 2 /* mean over the interval that ends at the stamp */
} driveid_hold;

typedef struct driveid_sample {
    driveid_stamp stamp;
    uint32_t present;                        /* bit s set: value[s] was measured */
    double value[DRIVEID_SIGNAL_COUNT];      /* SI, indexed by driveid_signal */
} driveid_sample;

/* Name with symbol and unit ("i_q_A"); NULL where signal is out of range. */
const char *driveid_signal_name(driveid_signal signal);

/* DRIVEID_OK and *signal, else DRIVEID_ERR_ARGUMENT. */
driveid_status driveid_signal_from_name(const char *name, driveid_signal *signal);

#ifdef __cplusplus
}
#endif
#endif
