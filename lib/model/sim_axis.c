/* SPDX-License-Identifier: Apache-2.0 */
/* One substep of the axis: implicit in damping, bristles and springs, event-driven where friction depends on the direction. */
#include "model/sim.h"

#include <math.h>

/* Losses without memory at the instant in `at`. */
static double losses(const driveid_sim *sim, const driveid_effect_state *at) {
    double sum = 0.0;
    for (uint32_t k = 0; k < sim->terms; k++) {
        const driveid_sim_term *term = &sim->term[k];
        double column[DRIVEID_EFFECT_COLUMNS_MAX], memory[DRIVEID_EFFECT_MEMORY] = {0};
        if (term->electrical) continue;
        if (!term->info) {
            sum += driveid_formula_value(&term->formula, at, term->param, NULL);
            continue;
        }
        term->info->fill(term->shape, at, memory, column);
        for (uint32_t c = 0; c < term->info->columns; c++) sum += term->linear[c] * column[c];
    }
    return sum;
}

static double inertia(const driveid_sim *sim, double t_s) {
    const double J = sim->J + (sim->dJ != 0.0 && t_s >= sim->t_step_s ? sim->dJ : 0.0);
    return J > 1e-3 * sim->J ? J : 1e-3 * sim->J;
}

/* ---- bristles: force at the middle of the substep = offset + slope * (omega_0 + omega_1) ---- */

typedef struct { double offset, slope; } affine;

static double bristle_rate(const driveid_sim_bristle *b, double speed) {
    const double x = speed / b->omega_s, level = 1.0 + (b->level - 1.0) * exp(-x * x);
    return fabs(speed) / (b->length * level);
}

static affine bristle_force(const driveid_sim *sim, const driveid_sim_state *state, double speed, double h) {
    affine sum = {0.0, 0.0};
    for (uint32_t k = 0; k < sim->bristles; k++) {
        const driveid_sim_bristle *b = &sim->bristle[k];
        const double zeta = state->memory[b->slot][0], rate = bristle_rate(b, speed), x = rate * h;
        const double decay = exp(-x), mean = x > 1e-6 ? (1.0 - decay) / rate : h;
        const double stiff = h * sqrt(fabs(b->force) / (b->length * sim->J)); /* beyond the substep's reach: lean on its end */
        const double w = stiff > 1.5 ? 1.0 : 0.5;
        sum.offset += b->force * zeta * ((1.0 - w) + w * decay + b->damping_s * (decay - 1.0) / h);
        sum.slope += b->force * mean / b->length * (w + b->damping_s / h) * 0.5;
    }
    return sum;
}

static void bristle_advance(const driveid_sim *sim, driveid_sim_state *state, double speed, double mean_speed, double h) {
    for (uint32_t k = 0; k < sim->bristles; k++) {
        const driveid_sim_bristle *b = &sim->bristle[k];
        double *zeta = &state->memory[b->slot][0];
        const double rate = bristle_rate(b, speed), x = rate * h, decay = exp(-x), mean = x > 1e-6 ? (1.0 - decay) / rate : h;
        *zeta = *zeta * decay + mean_speed / b->length * mean;
    }
}

static double bristle_at_rest(const driveid_sim *sim, const driveid_sim_state *state) {
    double sum = 0.0;
    for (uint32_t k = 0; k < sim->bristles; k++) sum += sim->bristle[k].force * state->memory[sim->bristle[k].slot][0];
    return sum;
}

/* ---- spring between two masses: torque at the middle = offset + slope * (sum of both ends' speed difference) ---- */

static double twist_in_contact(const driveid_sim *sim, double twist) {
    const double half = 0.5 * sim->gap;
    return twist > half ? twist - half : twist < -half ? twist + half : 0.0;
}

static affine spring(const driveid_sim *sim, const driveid_sim_state *state, double h) {
    affine s = {0.0, 0.0};
    const double *x = state->x;
    const double twist = x[DRIVEID_X_ANGLE] - x[DRIVEID_X_ANGLE_L], difference = x[DRIVEID_X_SPEED] - x[DRIVEID_X_SPEED_L];
    if (!sim->two_mass) return s;
    if (sim->gap > 0.0 && twist_in_contact(sim, twist + 0.5 * h * difference) == 0.0) return s;
    const double reduced = sim->J * sim->J_l / (sim->J + sim->J_l), omega = sqrt(fabs(sim->k) / reduced), half = fmin(0.5 * omega * h, 1.2);
    const double k = half > 1e-6 ? reduced * pow(2.0 / h * tan(half), 2.0) : sim->k;
    const double side = sim->gap > 0.0 ? copysign(0.5 * sim->gap, twist + 0.5 * h * difference) : 0.0;
    s.offset = k * (twist - side);
    s.slope = 0.25 * k * h + 0.5 * sim->d;
    return s;
}

/* ---- moving ---- */

typedef struct { double speed, speed_l; } ends;

static void look(const driveid_sim_state *state, driveid_effect_state *at, double h, int direction, int one_sided) {
    double middle = state->x[DRIVEID_X_SPEED] + 0.5 * h * state->accel;
    if (one_sided && middle * direction < 0.0) middle = 0.0;
    at->angle = state->x[DRIVEID_X_ANGLE] + 0.5 * h * state->x[DRIVEID_X_SPEED];
    at->speed = middle;
    at->direction = one_sided ? direction : (middle > 0.0) - (middle < 0.0);
    at->accel = state->accel;
}

static ends solve(const driveid_sim *sim, const driveid_sim_state *state, const driveid_effect_state *at, double h, double loss) {
    const double J = inertia(sim, at->t_s), w0 = state->x[DRIVEID_X_SPEED], l0 = state->x[DRIVEID_X_SPEED_L];
    const affine bristle = bristle_force(sim, state, at->speed, h), s = spring(sim, state, h);
    double a = J / h + 0.5 * sim->B + bristle.slope;
    if (!(a > 0.1 * J / h)) a = 0.1 * J / h;
    const double rhs = (J / h - 0.5 * sim->B - bristle.slope) * w0 + at->torque - loss - bristle.offset;
    if (!sim->two_mass) return (ends){rhs / a, 0.0};
    const double transmitted = s.offset + s.slope * (w0 - l0), c = s.slope, b = sim->J_l / h + c;
    const double r1 = rhs - transmitted, r2 = sim->J_l / h * l0 + transmitted, determinant = (a + c) * b - c * c;
    return (ends){(r1 * b + c * r2) / determinant, ((a + c) * r2 + c * r1) / determinant};
}

static void commit(const driveid_sim *sim, driveid_sim_state *state, const driveid_effect_state *at, double h, ends to) {
    double *x = state->x;
    const double mean = 0.5 * (x[DRIVEID_X_SPEED] + to.speed);
    bristle_advance(sim, state, at->speed, mean, h);
    state->accel = (to.speed - x[DRIVEID_X_SPEED]) / h;
    x[DRIVEID_X_ANGLE] += h * mean;
    x[DRIVEID_X_SPEED] = to.speed;
    if (sim->two_mass) {
        x[DRIVEID_X_ANGLE_L] += 0.5 * h * (x[DRIVEID_X_SPEED_L] + to.speed_l);
        x[DRIVEID_X_SPEED_L] = to.speed_l;
    }
}

/* Moves for at most h in one direction; returns the time used, less than h where the axis came to a stop. */
static double slide(const driveid_sim *sim, driveid_sim_state *state, driveid_effect_state *at, double h) {
    const double w0 = state->x[DRIVEID_X_SPEED];
    look(state, at, h, state->direction, 1);
    const double loss = losses(sim, at);
    ends to = solve(sim, state, at, h, loss);
    if (to.speed * state->direction >= 0.0) {
        commit(sim, state, at, h, to);
        return h;
    }
    const double used = h * fmin(1.0, fabs(w0) / (fabs(w0) + fabs(to.speed)));
    if (used > 1e-9 * h) {
        to = solve(sim, state, at, used, loss);
        to.speed = 0.0;
        commit(sim, state, at, used, to);
    }
    state->x[DRIVEID_X_SPEED] = 0.0;
    state->direction = 0;
    return used;
}

/* ---- at rest ---- */

/* Side on which the axis leaves, 0 where friction holds it. */
static int release(const driveid_sim *sim, const driveid_sim_state *state, driveid_effect_state *at) {
    const double *x = state->x;
    double pull = at->torque - bristle_at_rest(sim, state);
    if (sim->two_mass) {
        const double twist = twist_in_contact(sim, x[DRIVEID_X_ANGLE] - x[DRIVEID_X_ANGLE_L]);
        if (twist != 0.0 || sim->gap <= 0.0) pull -= sim->k * twist - sim->d * x[DRIVEID_X_SPEED_L];
    }
    at->angle = x[DRIVEID_X_ANGLE];
    at->speed = at->accel = 0.0;
    at->direction = 1.0;
    const double forward = losses(sim, at);
    at->direction = -1.0;
    const double backward = losses(sim, at);
    if (forward < backward) return pull > 0.5 * (forward + backward) ? 1 : -1; /* no friction at all, or a negative one during a fit */
    return pull > forward ? 1 : pull < backward ? -1 : 0;
}

static void rest(const driveid_sim *sim, driveid_sim_state *state, double h) {
    state->x[DRIVEID_X_SPEED] = state->accel = 0.0;
    if (!sim->two_mass) return;
    double *x = state->x;
    const affine s = spring(sim, state, h);
    const double l0 = x[DRIVEID_X_SPEED_L], b = sim->J_l / h + s.slope;
    const double l1 = ((sim->J_l / h - s.slope) * l0 + s.offset) / b;
    x[DRIVEID_X_ANGLE_L] += 0.5 * h * (l0 + l1);
    x[DRIVEID_X_SPEED_L] = l1;
}

void driveid_sim_axis_step(const driveid_sim *sim, driveid_sim_state *state, driveid_effect_state *at, double h, double drive) {
    at->drive = drive;
    at->gain = sim->gain;
    at->torque = sim->gain * drive;
    at->dt_s = h;
    if (!sim->has_direction) {
        look(state, at, h, 0, 0);
        commit(sim, state, at, h, solve(sim, state, at, h, losses(sim, at)));
        return;
    }
    if (state->x[DRIVEID_X_SPEED] != 0.0) state->direction = state->x[DRIVEID_X_SPEED] > 0.0 ? 1 : -1;
    double left = h;
    for (int pass = 0; pass < 4 && left > 1e-9 * h; pass++) {
        if (state->direction == 0) state->direction = release(sim, state, at);
        if (state->direction == 0) {
            rest(sim, state, left);
            return;
        }
        left -= slide(sim, state, at, left);
    }
}
