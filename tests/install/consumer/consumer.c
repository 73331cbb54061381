/* SPDX-License-Identifier: Apache-2.0 */
#include <stdio.h>
#include <string.h>

#include <driveid/estimate.h>
#include <driveid/sample.h>
#include <driveid/version.h>

int main(void)
{
    driveid_signal signal;
    if (driveid_signal_from_name("theta_rad", &signal) != DRIVEID_OK || strcmp(driveid_signal_name(signal), "theta_rad") != 0)
        return 1;
    if (driveid_estimator_size("fsm", DRIVEID_F64) == 0 || driveid_estimator_size("no such method", DRIVEID_F64) != 0)
        return 2;
    printf("driveid %s\n", DRIVEID_VERSION);
    return 0;
}
