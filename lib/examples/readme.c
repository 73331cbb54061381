/* SPDX-License-Identifier: Apache-2.0 */
#include <driveid/model.h>
#include <math.h>
#include <stdio.h>
static union { double align; unsigned char bytes[DRIVEID_ESTIMATOR_BYTES]; } memory;
int main(void) {
    driveid_estimator *e = (driveid_estimator *)memory.bytes;
    driveid_model m; driveid_online o; driveid_estimate a; driveid_param p[DRIVEID_THETA_MAX]; uint32_t valid;
    driveid_model_init(&m, DRIVEID_STRUCTURE_RIGID_AXIS), driveid_model_give(&m, "K_t_Nm_A", 0.05);
    driveid_online_init(&o, &m, 1u << DRIVEID_SIGNAL_I_A | 1u << DRIVEID_SIGNAL_THETA_RAD, NULL, 0);
    driveid_estimator_configure(e, sizeof memory, "fsm", DRIVEID_F64, &o.regression, &(driveid_estimator_options){.dt_s = 1e-3}, NULL, 0);
    for (int k = 0; k < 5000; k++) { /* your readings; here an axis of 1.2e-4 kg m^2 whose angle goes as sin(10 t) */
        double t = 1e-3 * k, x[DRIVEID_CHANNELS_MAX], theta = sin(10 * t), i_A = (-1.2e-4 * 100 * sin(10 * t) + 2e-4 * 10 * cos(10 * t)) / 0.05;
        driveid_sample s = {.stamp.t_ns = 1000000LL * k, .present = o.present, .value = {[DRIVEID_SIGNAL_I_A] = i_A, [DRIVEID_SIGNAL_THETA_RAD] = theta}};
        if (driveid_online_channels(&o, &s, x) == DRIVEID_OK) driveid_estimator_update(e, o.t_ns, x);
    }
    if (driveid_estimator_estimate(e, &a) || driveid_online_physical(&o, &a, p, &valid)) return 1;
    for (uint32_t n = 0; n < o.physical; n++) printf("%s = %.6g  [%.6g, %.6g] %s\n", p[n].name, p[n].value, p[n].lo, p[n].hi, p[n].unit);
}
