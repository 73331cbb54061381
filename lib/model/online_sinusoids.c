/* SPDX-License-Identifier: Apache-2.0 */
/* A signal without a model: what its sinusoids are called. */
#include <driveid/model.h>

#include <stdio.h>
#include <string.h>

#include "model/online.h"

static const struct {
    const char *suffix, *unit; /* of the amplitude's name; as shown */
} dimension[DRIVEID_SIGNAL_COUNT] = {
    {"_A", "A"}, {"_A", "A"}, {"_A", "A"}, {"_V", "V"}, {"_V", "V"}, {"_V", "V"}, {"_Nm", "N m"}, {"_N", "N"}, {"_rad", "rad"}, {"_rad_s", "rad/s"},
    {"_rad", "rad"}, {"_rad_s", "rad/s"}, {"_m", "m"}, {"_m_s", "m/s"}, {"_K", "K"}, {"", ""}, {"", ""},
};

driveid_status driveid_online_sinusoids(driveid_online *online, const driveid_regression *regression, driveid_signal signal) {
    if (!online || !regression || (unsigned)signal >= DRIVEID_SIGNAL_COUNT || regression->channels != 1 || 2u * regression->params > DRIVEID_THETA_MAX) return DRIVEID_ERR_ARGUMENT;
    memset(online, 0, sizeof *online);
    online->regression = *regression;
    online->mechanical = -1;
    online->present = UINT32_C(1) << signal;
    online->filler[0] = (driveid_online_channel){ONLINE_SIGNAL, (uint8_t)signal, (uint8_t)signal};
    online->physical = 2u * regression->params;
    for (unsigned i = 0; i < regression->params; i++) {
        snprintf(online->physical_name[2 * i], DRIVEID_NAME_SIZE, "f%u_Hz", i + 1);
        snprintf(online->physical_unit[2 * i], sizeof online->physical_unit[0], "Hz");
        snprintf(online->physical_name[2 * i + 1], DRIVEID_NAME_SIZE, "amplitude%u%s", i + 1, dimension[signal].suffix);
        snprintf(online->physical_unit[2 * i + 1], sizeof online->physical_unit[0], "%s", dimension[signal].unit);
    }
    return DRIVEID_OK;
}
