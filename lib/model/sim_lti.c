/* SPDX-License-Identifier: Apache-2.0 */
/* General input-output equation y^(n) + a_{n-1} y^(n-1) + ... + a_0 y = b_m u^(m) + ... + b_0 u in observer form,
 * x_k' = x_{k+1} - a_{n-1-k} (x_0 + b_n u) + b_{n-1-k} u, y = x_0 + b_n u; stepped by its Taylor series with scaling, exact to rounding
 * for an input that is held or linear between the stamps. */
#include "model/sim.h"

#include <math.h>
#include <string.h>

static double b_of(const driveid_sim *sim, uint32_t k) { return k <= sim->lti_m ? sim->lti_b[k] : 0.0; }

double driveid_sim_lti_output(const driveid_sim *sim, const double *x, double u) { return x[0] + b_of(sim, sim->lti_n) * u; }

static void derivative(const driveid_sim *sim, const double *x, double u, double *dx) {
    const uint32_t n = sim->lti_n;
    const double y = driveid_sim_lti_output(sim, x, u);
    for (uint32_t k = 0; k < n; k++) dx[k] = (k + 1 < n ? x[k + 1] : 0.0) - sim->lti_a[n - 1 - k] * y + b_of(sim, n - 1 - k) * u;
}

/* x(h) = sum h^j/j! x^(j): the derivatives follow from the equation itself, u' constant. */
static void taylor(const driveid_sim *sim, double *x, double h, double u, double slope) {
    double term[6], next[6], sum[6];
    memcpy(sum, x, sizeof sum);
    memcpy(term, x, sizeof term);
    double input = u;
    for (int j = 1; j <= 14; j++) {
        derivative(sim, term, input, next);
        input = j == 1 ? slope : 0.0;
        for (uint32_t k = 0; k < sim->lti_n; k++) {
            term[k] = next[k] * h / j;
            sum[k] += term[k];
        }
        input *= h / j; /* keeps pace with the scaling of the term */
    }
    memcpy(x, sum, sizeof(double) * sim->lti_n);
}

void driveid_sim_lti_step(const driveid_sim *sim, double *x, double h, double u0, double u1) {
    double size = 1.0;
    for (uint32_t k = 0; k < sim->lti_n; k++) size = fmax(size, pow(fabs(sim->lti_a[k]) * sim->lti_n, 1.0 / (sim->lti_n - k)));
    const int parts = (int)fmin(64.0, ceil(size * h / 0.5));
    const double slope = (u1 - u0) / h;
    for (int p = 0; p < parts; p++) taylor(sim, x, h / parts, u0 + slope * h * p / parts, slope);
}
