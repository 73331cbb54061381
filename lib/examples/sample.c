/* SPDX-License-Identifier: Apache-2.0 */
/* sample.h, time.h, status.h: signals by name, stamps, statuses as sentences. */
#include <driveid/sample.h>
#include <stdio.h>

int main(void) {
    driveid_signal signal;
    driveid_sample sample = {.stamp = {.t_ns = 5 * DRIVEID_NS_PER_S, .err_ns = 20000, .clock = DRIVEID_CLOCK_KERNEL}};
    if (driveid_signal_from_name("omega_rad_s", &signal) != DRIVEID_OK) return 1;
    sample.present |= UINT32_C(1) << signal;
    sample.value[signal] = 12.5;
    printf("%s = %g at %lld ns\n", driveid_signal_name(signal), sample.value[signal], (long long)sample.stamp.t_ns);
    const driveid_status s = driveid_signal_from_name("rpm", &signal);
    printf("rpm: %s\n", driveid_status_text(s));
    return s != DRIVEID_ERR_ARGUMENT;
}
