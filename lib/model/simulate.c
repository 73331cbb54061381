/* SPDX-License-Identifier: Apache-2.0 */
/* The run: rows of the record, substeps between them, and what the sensors would read. */
#include "model/sim.h"

#include <math.h>
#include <string.h>

#define SUBSTEPS_MAX 48

double driveid_sim_mean(const driveid_sim_record *r, const double *channel, driveid_hold hold, double from_s, double to_s, size_t *hint) {
    size_t k = *hint < r->rows ? *hint : r->rows - 1;
    const double middle = 0.5 * (from_s + to_s), first = hold == DRIVEID_HOLD_FIRST ? middle : from_s;
    while (k > 0 && r->t_s[k] > first) k--;
    while (k + 1 < r->rows && r->t_s[k + 1] <= first) k++;
    *hint = k;
    if (hold == DRIVEID_HOLD_FIRST) {
        if (k + 1 >= r->rows || middle <= r->t_s[0]) return channel[k];
        return channel[k] + (channel[k + 1] - channel[k]) * (middle - r->t_s[k]) / (r->t_s[k + 1] - r->t_s[k]);
    }
    /* held: value of [t_k, t_k+1) is channel[k] (zero order) or channel[k + 1] (average over the interval that ends at its stamp) */
    const size_t shift = hold == DRIVEID_HOLD_AVERAGE ? 1 : 0;
    double sum = 0.0, at = from_s;
    for (;;) {
        const size_t value = from_s < r->t_s[0] && at < r->t_s[0] ? 0 : (k + shift < r->rows ? k + shift : r->rows - 1);
        const double knot = at < r->t_s[0] ? r->t_s[0] : k + 1 < r->rows ? r->t_s[k + 1] : to_s;
        const double end = knot < to_s && knot > at ? knot : to_s;
        sum += channel[value] * (end - at);
        if (end >= to_s) break;
        if (at >= r->t_s[0]) k++;
        at = end;
    }
    return to_s > from_s ? sum / (to_s - from_s) : channel[k];
}

/* ---- start ---- */

static const double *either(const driveid_sim *sim, driveid_signal a, driveid_signal b) {
    return sim->record.signal[a] ? sim->record.signal[a] : sim->record.signal[b];
}

static double slope_at(const driveid_sim *sim, const double *angle, size_t row) {
    const size_t from = row >= 3 ? row - 3 : 0, to = row + 4 < sim->record.rows ? row + 4 : sim->record.rows;
    double n = 0, t = 0, y = 0, tt = 0, ty = 0;
    for (size_t k = from; k < to; k++) {
        const double dt = sim->record.t_s[k] - sim->record.t_s[row];
        n += 1, t += dt, y += angle[k], tt += dt * dt, ty += dt * angle[k];
    }
    const double d = n * tt - t * t;
    return d > 0.0 ? (n * ty - t * y) / d : 0.0;
}

static double undo_eccentricity(const driveid_sim *sim, double read) {
    double angle = read;
    for (int k = 0; k < 3; k++) angle = read - sim->ecc_a * sin(angle + sim->ecc_phi);
    return angle;
}

driveid_status driveid_sim_start(const driveid_sim *sim, size_t row, driveid_sim_state *state) {
    if (!sim || !state || row >= sim->record.rows) return DRIVEID_ERR_ARGUMENT;
    memset(state, 0, sizeof *state);
    double *x = state->x;
    if (sim->structure == DRIVEID_STRUCTURE_LTI) {
        const double *y = sim->record.signal[DRIVEID_SIGNAL_Y];
        x[0] = y ? y[row] : 0.0;
        return DRIVEID_OK;
    }
    const double *angle = either(sim, DRIVEID_SIGNAL_THETA_RAD, DRIVEID_SIGNAL_X_M), *speed = either(sim, DRIVEID_SIGNAL_OMEGA_RAD_S, DRIVEID_SIGNAL_V_M_S);
    const double *current = either(sim, DRIVEID_SIGNAL_I_Q_A, DRIVEID_SIGNAL_I_A), *current_d = sim->record.signal[DRIVEID_SIGNAL_I_D_A];
    const double *load = sim->record.signal[DRIVEID_SIGNAL_THETA_L_RAD], *load_speed = sim->record.signal[DRIVEID_SIGNAL_OMEGA_L_RAD_S];
    x[DRIVEID_X_ANGLE] = angle ? undo_eccentricity(sim, angle[row]) : 0.0;
    x[DRIVEID_X_SPEED] = speed ? speed[row] : angle ? slope_at(sim, angle, row) : 0.0;
    x[DRIVEID_X_ANGLE_L] = load ? load[row] : x[DRIVEID_X_ANGLE];
    x[DRIVEID_X_SPEED_L] = load_speed ? load_speed[row] : x[DRIVEID_X_SPEED];
    x[DRIVEID_X_CURRENT] = current ? current[row] - sim->i_0 : 0.0;
    x[DRIVEID_X_CURRENT_D] = current_d ? current_d[row] : 0.0;
    return DRIVEID_OK;
}

uint32_t driveid_sim_free_states(const driveid_sim *sim, uint32_t index[DRIVEID_X_COUNT]) {
    uint32_t n = 0;
    if (sim->structure == DRIVEID_STRUCTURE_LTI) {
        for (uint32_t k = 0; k < sim->lti_n; k++) index[n++] = k;
        return n;
    }
    if (sim->axis) index[n++] = DRIVEID_X_ANGLE, index[n++] = DRIVEID_X_SPEED;
    if (sim->axis && sim->two_mass) index[n++] = DRIVEID_X_ANGLE_L, index[n++] = DRIVEID_X_SPEED_L;
    if (sim->circuit) index[n++] = DRIVEID_X_CURRENT;
    if (sim->circuit && sim->dq) index[n++] = DRIVEID_X_CURRENT_D;
    return n;
}

/* ---- what the sensors read ---- */

static void read_axis(const driveid_sim *sim, const driveid_sim_state *state, double *const out[], size_t at) {
    const double *x = state->x;
    const double bend = sim->ecc_a != 0.0 ? sim->ecc_a * sin(x[DRIVEID_X_ANGLE] + sim->ecc_phi) : 0.0;
    const double stretch = sim->ecc_a != 0.0 ? 1.0 + sim->ecc_a * cos(x[DRIVEID_X_ANGLE] + sim->ecc_phi) : 1.0;
    const double angle = x[DRIVEID_X_ANGLE] + bend, speed = x[DRIVEID_X_SPEED] * stretch;
    if (sim->structure == DRIVEID_STRUCTURE_LINEAR_AXIS) {
        if (out[DRIVEID_SIGNAL_X_M]) out[DRIVEID_SIGNAL_X_M][at] = angle;
        if (out[DRIVEID_SIGNAL_V_M_S]) out[DRIVEID_SIGNAL_V_M_S][at] = speed;
        return;
    }
    if (out[DRIVEID_SIGNAL_THETA_RAD]) out[DRIVEID_SIGNAL_THETA_RAD][at] = angle;
    if (out[DRIVEID_SIGNAL_OMEGA_RAD_S]) out[DRIVEID_SIGNAL_OMEGA_RAD_S][at] = speed;
    if (out[DRIVEID_SIGNAL_THETA_L_RAD]) out[DRIVEID_SIGNAL_THETA_L_RAD][at] = sim->two_mass ? x[DRIVEID_X_ANGLE_L] : x[DRIVEID_X_ANGLE];
    if (out[DRIVEID_SIGNAL_OMEGA_L_RAD_S]) out[DRIVEID_SIGNAL_OMEGA_L_RAD_S][at] = sim->two_mass ? x[DRIVEID_X_SPEED_L] : x[DRIVEID_X_SPEED];
}

static void read_out(const driveid_sim *sim, const driveid_sim_state *state, double *const out[], size_t at, double u) {
    if (sim->structure == DRIVEID_STRUCTURE_LTI) {
        if (out[DRIVEID_SIGNAL_Y]) out[DRIVEID_SIGNAL_Y][at] = driveid_sim_lti_output(sim, state->x, u);
        return;
    }
    if (sim->axis) read_axis(sim, state, out, at);
    if (!sim->circuit) return;
    const double i = state->x[DRIVEID_X_CURRENT] + sim->i_0;
    if (out[DRIVEID_SIGNAL_I_Q_A] && sim->dq) out[DRIVEID_SIGNAL_I_Q_A][at] = i;
    if (out[DRIVEID_SIGNAL_I_D_A] && sim->dq) out[DRIVEID_SIGNAL_I_D_A][at] = state->x[DRIVEID_X_CURRENT_D];
    if (out[DRIVEID_SIGNAL_I_A] && !sim->dq) out[DRIVEID_SIGNAL_I_A][at] = i;
}

uint32_t driveid_sim_outputs(const driveid_sim *sim) {
    uint32_t bits = 0;
    if (sim->structure == DRIVEID_STRUCTURE_LTI) return 1u << DRIVEID_SIGNAL_Y;
    if (sim->axis && sim->structure == DRIVEID_STRUCTURE_LINEAR_AXIS) bits |= 1u << DRIVEID_SIGNAL_X_M | 1u << DRIVEID_SIGNAL_V_M_S;
    else if (sim->axis) bits |= 1u << DRIVEID_SIGNAL_THETA_RAD | 1u << DRIVEID_SIGNAL_OMEGA_RAD_S;
    if (sim->axis && sim->two_mass && sim->structure != DRIVEID_STRUCTURE_LINEAR_AXIS) bits |= 1u << DRIVEID_SIGNAL_THETA_L_RAD | 1u << DRIVEID_SIGNAL_OMEGA_L_RAD_S;
    if (sim->circuit && sim->dq) bits |= 1u << DRIVEID_SIGNAL_I_Q_A | 1u << DRIVEID_SIGNAL_I_D_A;
    if (sim->circuit && !sim->dq) bits |= 1u << DRIVEID_SIGNAL_I_A;
    return bits;
}

/* ---- the run ---- */

static int substeps(const driveid_sim *sim, const driveid_sim_state *state, double dt) {
    double n = ceil(dt / sim->substep_s - 1e-9);
    if (sim->order_max > 0.0) n = fmax(n, ceil(sim->order_max * fabs(state->x[DRIVEID_X_SPEED]) * dt / 0.6));
    if (sim->dq && sim->circuit) n = fmax(n, ceil(sim->pole_pairs * fabs(state->x[DRIVEID_X_SPEED]) * dt / 0.3));
    return n < 1.0 || !(n == n) ? 1 : n > SUBSTEPS_MAX ? SUBSTEPS_MAX : (int)n;
}

/* Quadrature current that gives the same torque without reluctance. */
static double reluctance(const driveid_sim *sim, double i_q, double i_d) {
    return sim->psi_pm > 0.0 ? i_q * (1.0 + (sim->L - sim->L_q) * i_d / sim->psi_pm) : i_q;
}

/* Circuit and axis over one substep: current first, with the speed extrapolated to the middle, then the axis with the mean current. */
static void both(const driveid_sim *sim, driveid_sim_state *state, driveid_effect_state *at, double h, double v, double v_d) {
    const double i0 = state->x[DRIVEID_X_CURRENT], d0 = state->x[DRIVEID_X_CURRENT_D], speed = state->x[DRIVEID_X_SPEED] + 0.5 * h * state->accel;
    if (sim->dq) driveid_sim_dq_step(sim, state, at, h, v_d, v, speed);
    else driveid_sim_circuit_step(sim, state, at, h, v, speed);
    double drive = 0.5 * (i0 + state->x[DRIVEID_X_CURRENT]);
    if (sim->dq) drive = reluctance(sim, drive, 0.5 * (d0 + state->x[DRIVEID_X_CURRENT_D]));
    at->current_A = drive;
    driveid_sim_axis_step(sim, state, at, h, drive);
}

typedef struct { size_t drive, drive_d, speed; } hints;

static void substep(const driveid_sim *sim, driveid_sim_state *state, driveid_effect_state *at, double from, double h, hints *hint) {
    const driveid_sim_record *r = &sim->record;
    const double shifted = from - sim->delay_s;
    const double u = driveid_sim_mean(r, sim->drive, r->hold, shifted, shifted + h, &hint->drive);
    at->t_s = from + 0.5 * h - r->t_s[0];
    if (sim->circuit && sim->axis) {
        both(sim, state, at, h, u, sim->dq ? driveid_sim_mean(r, sim->drive_d, r->hold, shifted, shifted + h, &hint->drive_d) : 0.0);
    } else if (sim->circuit) {
        const double speed = driveid_sim_mean(r, sim->speed_in, DRIVEID_HOLD_FIRST, from, from + h, &hint->speed);
        state->x[DRIVEID_X_SPEED] = speed;
        if (sim->dq) driveid_sim_dq_step(sim, state, at, h, driveid_sim_mean(r, sim->drive_d, r->hold, shifted, shifted + h, &hint->drive_d), u, speed);
        else driveid_sim_circuit_step(sim, state, at, h, u, speed);
    } else {
        const double i_d = sim->drive_d ? driveid_sim_mean(r, sim->drive_d, r->hold, shifted, shifted + h, &hint->drive_d) : 0.0;
        at->current_A = at->voltage_V = u;
        driveid_sim_axis_step(sim, state, at, h, sim->dq ? reluctance(sim, u, i_d) : u);
    }
}

static void interval_lti(const driveid_sim *sim, driveid_sim_state *state, size_t row) {
    const double *u = sim->drive, h = sim->record.t_s[row + 1] - sim->record.t_s[row];
    const double u0 = sim->record.hold == DRIVEID_HOLD_AVERAGE ? u[row + 1] : u[row], u1 = sim->record.hold == DRIVEID_HOLD_ZERO ? u[row] : u[row + 1];
    driveid_sim_lti_step(sim, state->x, h, u0, u1);
}

static void interval(const driveid_sim *sim, driveid_sim_state *state, driveid_effect_state *at, size_t row, hints *hint) {
    const double from = sim->record.t_s[row], dt = sim->record.t_s[row + 1] - from;
    if (sim->structure == DRIVEID_STRUCTURE_LTI) {
        interval_lti(sim, state, row);
        return;
    }
    if (at->has_temperature) at->T_degC = sim->record.signal[DRIVEID_SIGNAL_T_DEGC][row];
    const int n = substeps(sim, state, dt);
    const double h = dt / n;
    for (int k = 0; k < n; k++) substep(sim, state, at, from + k * h, h, hint);
}

static int lost(const driveid_sim_state *state) {
    for (int k = 0; k < DRIVEID_X_COUNT; k++)
        if (!(fabs(state->x[k]) < 1e12)) return 1;
    return 0;
}

static void fill_nan(double *const out[], size_t from, size_t to) {
    for (int s = 0; s < DRIVEID_SIGNAL_COUNT; s++)
        for (size_t k = from; out[s] && k < to; k++) out[s][k] = NAN;
}

driveid_status driveid_sim_run(const driveid_sim *sim, size_t from, size_t to, driveid_sim_state *state, double *const out[DRIVEID_SIGNAL_COUNT]) {
    if (!sim || !state || !out || from >= to || to > sim->record.rows) return DRIVEID_ERR_ARGUMENT;
    driveid_effect_state at;
    memset(&at, 0, sizeof at);
    at.has_temperature = sim->record.signal[DRIVEID_SIGNAL_T_DEGC] != NULL;
    hints hint = {from, from, from};
    for (size_t row = from; row < to; row++) {
        if (lost(state)) {
            fill_nan(out, row - from, to - from);
            return DRIVEID_ERR_NUMERIC;
        }
        read_out(sim, state, out, row - from, sim->drive[row]);
        if (row + 1 < to) interval(sim, state, &at, row, &hint);
    }
    return DRIVEID_OK;
}

driveid_status driveid_simulate(const driveid_model *model, const driveid_sim_record *record, double *const out[DRIVEID_SIGNAL_COUNT], char *message, size_t message_size) {
    driveid_sim sim;
    driveid_sim_state state;
    driveid_status s = driveid_sim_init(&sim, model, record, DRIVEID_SIM_WHOLE, message, message_size);
    if (!s) s = driveid_sim_start(&sim, 0, &state);
    return s ? s : driveid_sim_run(&sim, 0, record->rows, &state, out);
}
