/* SPDX-License-Identifier: Apache-2.0 */
#include "watch.h"

void watch_motion(driveid_svf_common *common, unsigned e, const double *phi, const double *square, double weight, double dt_s,
                  double *least, double *most) {
    const fsm_equation *q = &common->equation[e];
    const double share = dt_s / (FSM_MOTION_S + dt_s);
    for (unsigned j = 0; j < q->params; j++) {
        if (!(common->motion_mask >> q->param[j] & 1)) continue;
        double *motion = &common->motion[q->param[j]];
        *motion += share * (phi[j] * phi[j] - *motion);
        const double usual = weight > 0 ? square[j] / weight : 0;
        const double relative = usual > 0 ? *motion / usual : 1;
        if (relative < *least) *least = relative;
        if (relative > *most) *most = relative;
    }
}

int watch_residual(driveid_svf_common *common, unsigned e, const double *phi, double y, double dt_s) {
    const fsm_equation *q = &common->equation[e];
    const driveid_estimate *a = &common->answer;
    if (!common->watched || common->status == DRIVEID_NOT_YET) return 0;
    const unsigned p = common->regression.params;
    double residual = y, drive = y * y, spread = 0;
    for (unsigned i = 0; i < q->params; i++) {
        const double part = phi[i] * a->theta[q->param[i]];
        residual -= part;
        if (part * part > drive) drive = part * part;
        for (unsigned j = 0; j < q->params; j++) spread += phi[i] * a->cov[(unsigned)q->param[i] * p + (unsigned)q->param[j]] * phi[j];
    }
    return driveid_monitor_feed(&common->monitor[e], residual, drive, spread > 0 ? spread : 0, dt_s);
}
