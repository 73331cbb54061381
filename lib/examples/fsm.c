/* SPDX-License-Identifier: Apache-2.0 */
/* fsm.h: mass, damper and spring from one second of motion, whatever it did before. */
#include <driveid/fsm.h>
#include <math.h>
#include <stdio.h>

int main(void) {
    static driveid_fsm_f64 e;
    const driveid_fsm_config config = {.order = 2, .zeros = 0, .poles = 5, .pole_rad_s = {10, 10.5, 11, 11.5, 12}, .q_per_s = 0.3,
                                       .hold_y = DRIVEID_HOLD_FIRST, .hold_u = DRIVEID_HOLD_ZERO};
    char reason[160];
    if (driveid_fsm_configure_f64(&e, &config, reason, sizeof reason)) return printf("refused: %s\n", reason), 1;
    const double m = 2, c = 4, k = 400, u = 4, decay = c / (2 * m), w = sqrt(k / m - decay * decay);
    for (int n = 0; n <= 1000; n++) {
        const double t = 1e-3 * n, y = u / k + exp(-decay * t) * 0.3 * cos(w * t);
        driveid_fsm_update_f64(&e, INT64_C(1000000) * n, y, u);
    }
    driveid_fsm_estimate a;
    if (driveid_fsm_estimate_f64(&e, &a)) return 1;
    printf("m = %.6f kg, c = %.6f N s/m, k = %.4f N/m\n", 1 / a.b[0], a.a[1] / a.b[0], a.a[0] / a.b[0]);
    return fabs(1 / a.b[0] - m) > 1e-3 || fabs(a.a[1] / a.b[0] - c) > 1e-2 || fabs(a.a[0] / a.b[0] - k) > 0.1;
}
