/* SPDX-License-Identifier: Apache-2.0 */
/* One substep of the winding. */
#include "model/sim.h"

#include <math.h>

static double resistance(const driveid_sim *sim, driveid_sim_state *state, const driveid_effect_state *at, double current, double h) {
    if (sim->dR == 0.0) return sim->R;
    double *heat = &state->memory[sim->resistance_slot][0];
    if (at->has_temperature) *heat = (at->T_degC - 20.0) / 10.0;
    else *heat = current * current + (*heat - current * current) * exp(-h / sim->T_th_s);
    return sim->R + sim->dR * *heat;
}

static double own_voltage(const driveid_sim *sim, driveid_effect_state *at) {
    double sum = 0.0;
    for (uint32_t k = 0; k < sim->terms; k++)
        if (sim->term[k].electrical && !sim->term[k].info) sum += driveid_formula_value(&sim->term[k].formula, at, sim->term[k].param, NULL);
    return sum;
}

/* L di/dt = e - R i for h seconds; returns the current at the end. */
static double winding(double i, double e, double R, double L, double h) {
    if (!(L > 1e-9)) return R > 0.0 ? e / R : i;
    if (!(R > 1e-9)) return i + h * e / L;
    const double end = e / R;
    return end + (i - end) * exp(-R * h / L);
}

void driveid_sim_circuit_step(const driveid_sim *sim, driveid_sim_state *state, driveid_effect_state *at, double h, double v, double speed) {
    double *i = &state->x[DRIVEID_X_CURRENT];
    at->voltage_V = v;
    at->current_A = *i;
    at->speed = speed;
    const double R = resistance(sim, state, at, *i, h);
    const double dead = fmax(-sim->u_d, fmin(sim->u_d, v));
    const double e = v - dead - sim->K_e * speed - own_voltage(sim, at);
    if (sim->V_d == 0.0) {
        *i = winding(*i, e, R, sim->L, h);
        return;
    }
    double left = h;
    for (int pass = 0; pass < 3 && left > 1e-9 * h; pass++) {
        int side = (*i > 0.0) - (*i < 0.0);
        if (side == 0) side = e > sim->V_d ? 1 : e < -sim->V_d ? -1 : 0;
        if (side == 0) return; /* the inverter blocks */
        const double next = winding(*i, e - side * sim->V_d, R, sim->L, left);
        if (next * side >= 0.0) {
            *i = next;
            return;
        }
        left *= 1.0 - fabs(*i) / (fabs(*i) + fabs(next));
        *i = 0.0;
    }
}

void driveid_sim_dq_step(const driveid_sim *sim, driveid_sim_state *state, driveid_effect_state *at, double h, double v_d, double v_q, double speed) {
    double *i_d = &state->x[DRIVEID_X_CURRENT_D], *i_q = &state->x[DRIVEID_X_CURRENT];
    const double w = sim->pole_pairs * speed, size = hypot(*i_d, *i_q);
    at->voltage_V = v_q;
    at->current_A = *i_q;
    at->speed = speed;
    const double R = resistance(sim, state, at, size, h), lost = size > 1e-9 ? sim->V_d / size : 0.0;
    const double e_d = v_d - lost * *i_d, e_q = v_q - lost * *i_q - w * sim->psi_pm - own_voltage(sim, at);
    /* trapezoidal rule: (L/h + R/2) i1 -+ w L/2 j1 = (L/h - R/2) i0 +- w L/2 j0 + e */
    const double a = sim->L / h + 0.5 * R, d = sim->L_q / h + 0.5 * R, b = -0.5 * w * sim->L_q, c = 0.5 * w * sim->L;
    const double r_d = (sim->L / h - 0.5 * R) * *i_d - b * *i_q + e_d, r_q = (sim->L_q / h - 0.5 * R) * *i_q - c * *i_d + e_q;
    const double determinant = a * d - b * c;
    *i_d = (r_d * d - b * r_q) / determinant;
    *i_q = (a * r_q - c * r_d) / determinant;
}
