/* SPDX-License-Identifier: Apache-2.0 */
#include "fsm_low.h"

#include <string.h>

void fsm_low_init(fsm_low *low, unsigned channels, unsigned sections, const double *pole_rad_s, const uint8_t *level) {
    const uint8_t smooth[1] = {0};
    memset(low, 0, sizeof *low);
    low->sections = (uint8_t)sections;
    memcpy(low->level, level, channels);
    for (unsigned k = 0; k < FSM_LOW; k++) driveid_bank_init_f64(&low->kernel[k], 0, (uint8_t)sections, pole_rad_s[k], smooth, smooth);
}

void fsm_low_start(fsm_low *low, unsigned channels, const double *channel, const double *slope) {
    for (unsigned c = 0; c < channels; c++) {
        for (unsigned j = 0; j < low->sections; j++)
            for (unsigned k = 0; k < FSM_LOW; k++) low->w[c][j][k] = low->level[c] ? -channel[c] : 0;
        low->input[c] = channel[c];
        low->slope[c] = slope[c];
    }
}

static void coefficients(fsm_low *low, int64_t dt_ns) {
    for (unsigned k = 0; k < FSM_LOW; k++) {
        driveid_bank_f64 *kernel = &low->kernel[k];
        driveid_bank_coefficients_f64(kernel, dt_ns);
        for (unsigned j = 0; j < low->sections; j++) {
            low->p[j][k] = kernel->p[j];
            low->f[j][k] = kernel->f[j];
            low->q[j][k] = kernel->q[j];
            low->c[j][k] = kernel->c[j];
        }
    }
    low->dt_ns = dt_ns;
}

void fsm_low_step(fsm_low *low, unsigned channels, int64_t dt_ns, const double *channel, const double *slope) {
    const double h = (double)dt_ns * 1e-9;
    if (dt_ns != low->dt_ns) coefficients(low, dt_ns);
    for (unsigned c = 0; c < channels; c++) {
        const double move = channel[c] - low->input[c], from = h * low->slope[c], to = h * slope[c];
        const double a = 3 * move - 2 * from - to, b = from + to - 2 * move;
        low->input[c] = channel[c];
        low->slope[c] = slope[c];
        for (unsigned i = low->sections; i-- > 0;) {
            double sum[FSM_LOW] = {0};
            for (unsigned j = 0; j <= i; j++)
                for (unsigned k = 0; k < FSM_LOW; k++) sum[k] += low->p[i - j][k] * low->w[c][j][k];
            for (unsigned k = 0; k < FSM_LOW; k++) low->w[c][i][k] = sum[k] + (low->q[i][k] * a + low->c[i][k] * b - low->f[i][k] * move);
        }
    }
}

void fsm_low_add(const fsm_low *low, unsigned channel, unsigned derivative, double factor, double *sum) {
    const double *binomial = driveid_bank_binomial_f64[derivative];
    double value[FSM_LOW] = {0};
    for (unsigned m = 0; m <= derivative && m < low->sections; m++)
        for (unsigned k = 0; k < FSM_LOW; k++) value[k] += binomial[m] * low->w[channel][low->sections - 1 - m][k];
    for (unsigned k = 0; k < FSM_LOW; k++) {
        if (derivative == 0) value[k] += low->input[channel];
        for (unsigned i = 0; i < derivative; i++) value[k] *= low->kernel[k].pole_rad_s;
        sum[k] += factor * value[k];
    }
}
