/* SPDX-License-Identifier: Apache-2.0 */
#include <driveid/sample.h>

#include <stddef.h>
#include <string.h>

static const char *const names[DRIVEID_SIGNAL_COUNT] = {
    "i_A", "i_d_A", "i_q_A", "v_V", "v_d_V", "v_q_V", "tau_Nm", "F_N", "theta_rad", "omega_rad_s",
    "theta_l_rad", "omega_l_rad_s", "x_m", "v_m_s", "T_degC", "u", "y",
};

const char *driveid_signal_name(driveid_signal signal) {
    return (unsigned)signal < DRIVEID_SIGNAL_COUNT ? names[signal] : NULL;
}

driveid_status driveid_signal_from_name(const char *name, driveid_signal *signal) {
    if (!name || !signal) return DRIVEID_ERR_ARGUMENT;
    for (unsigned s = 0; s < DRIVEID_SIGNAL_COUNT; s++)
        if (strcmp(name, names[s]) == 0) {
            *signal = (driveid_signal)s;
            return DRIVEID_OK;
        }
    return DRIVEID_ERR_ARGUMENT;
}
