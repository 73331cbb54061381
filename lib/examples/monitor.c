/* SPDX-License-Identifier: Apache-2.0 */
/* monitor.h: does the model still explain the drive? The friction rises by 10 % after 30 s. */
#include <driveid/monitor.h>
#include <math.h>
#include <stdio.h>

int main(void) {
    driveid_monitor monitor;
    driveid_monitor_init(&monitor, 0);
    for (int k = 0; k < 400 * 60; k++) { /* a row each 2.5 ms */
        const double t = 0.0025 * k, tau_Nm = 0.1 * sin(6 * t), noise = 2e-4 * sin(1000 * t * t);
        const double missing = t > 30 ? 0.01 * sin(6 * t) : 0;
        if (driveid_monitor_feed(&monitor, noise + missing, tau_Nm * tau_Nm, 0, 0.0025)) {
            printf("alarm at %.2f s: residual %.2g N m rms, limit %.2g N m\n", t, sqrt(monitor.last_e2), sqrt(monitor.last_limit));
            return t < 30 || t > 31;
        }
    }
    return 1;
}
