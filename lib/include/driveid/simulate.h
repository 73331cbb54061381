/* SPDX-License-Identifier: Apache-2.0 */
/* Simulation of a model: structure and all its effects, on the inputs of a record.
 *
 * Purpose     free runs, windows and one-step predictions, for compare, fit, power and anybody who asks "what would it do".
 * Model       CONTRACT of structures and effects (model.h, effect.h).
 * Method      one fixed number of substeps a sample. Axis: trapezoidal rule, implicit in damping, bristles and springs (no step is too
 *             stiff), midpoint in everything else; friction that depends on direction is event-driven: the zero crossing is located inside
 *             the substep, the axis sticks while the driving torque lies between the two break-away levels, and leaves on its own side
 *             (Karnopp's idea without a speed band, so nothing chatters). Springs are prewarped: the discrete resonance is the true one.
 *             Circuit: exact exponential over a substep. dq: trapezoidal. lti: exact for its hold.
 * Input       the driving channel as it was held (driveid_hold), shifted by a `delay` with the fraction of a sample kept.
 * Cost        60,000 samples of a rigid axis with three effects: under 30 ms (tests/effect: simulate_speed).
 * Accuracy    tests/effect: simulate_* compares every effect with an independent small-step integration. */
#ifndef DRIVEID_SIMULATE_H
#define DRIVEID_SIMULATE_H

#include <stddef.h>
#include <stdint.h>

#include <driveid/effect.h>
#include <driveid/model.h>
#include <driveid/sample.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum driveid_sim_mode {
    DRIVEID_SIM_WHOLE = 0,   /* free run: input alone. With voltage: circuit and axis together */
    DRIVEID_SIM_MECHANICAL,  /* axis alone, driven by the measured current (torque, force) */
    DRIVEID_SIM_ELECTRICAL   /* circuit alone, with the measured speed */
} driveid_sim_mode;

/* Columns of one gap-free stretch, SI, all finite; NULL where absent. The caller keeps them alive. */
typedef struct driveid_sim_record {
    size_t rows;
    const double *t_s;                            /* increasing; t_s[0] need not be 0 */
    const double *signal[DRIVEID_SIGNAL_COUNT];
    driveid_hold hold;                            /* of the driving channel */
} driveid_sim_record;

enum { DRIVEID_X_ANGLE = 0, DRIVEID_X_SPEED, DRIVEID_X_ANGLE_L, DRIVEID_X_SPEED_L, DRIVEID_X_CURRENT, DRIVEID_X_CURRENT_D, DRIVEID_X_COUNT };

typedef struct driveid_sim_state {
    double x[DRIVEID_X_COUNT];                    /* lti: its own states */
    double accel;
    int direction, current_direction;             /* sign of motion; 0: sticks */
    double memory[DRIVEID_MODEL_EFFECTS_MAX][DRIVEID_EFFECT_MEMORY];
} driveid_sim_state;

typedef struct driveid_sim_term {
    const driveid_effect_info *info;              /* NULL: own effect */
    uint8_t electrical;
    double shape[DRIVEID_EFFECT_SHAPES_MAX], linear[DRIVEID_EFFECT_COLUMNS_MAX];
    double param[DRIVEID_PARAMS_MAX];
    uint8_t slot;                                 /* index of the effect in the model */
    driveid_formula formula;
} driveid_sim_term;

/* A bristle (lugre, hysteresis). */
typedef struct driveid_sim_bristle { double force, omega_s, level, length, damping_s; uint8_t slot; } driveid_sim_bristle;

/* A model made ready to run on one record; caller-owned, no pointers into itself. */
typedef struct driveid_sim {
    driveid_structure structure;
    driveid_sim_mode mode;
    driveid_sim_record record;
    uint8_t axis, circuit, dq, lumped_circuit;    /* what is simulated */
    const double *drive, *drive_d;                /* driving channel: voltage(s), or current, torque, force */
    const double *speed_in;                       /* circuit alone: measured speed */
    double J, B, gain;
    uint8_t two_mass, has_direction, dead_zone_on_voltage;
    double J_l, k, d, gap;
    double dJ, t_step_s;
    double R, L, K_e, L_q, psi_pm, pole_pairs, V_d, u_d, i_0, dR, T_th_s;
    uint8_t resistance_slot;
    double delay_s, ecc_a, ecc_phi, order_max;
    uint32_t lti_n, lti_m;
    double lti_a[6], lti_b[7];
    uint32_t terms, bristles;
    driveid_sim_term term[DRIVEID_MODEL_EFFECTS_MAX];
    driveid_sim_bristle bristle[DRIVEID_MODEL_EFFECTS_MAX];
    double substep_s;                             /* longest substep */
} driveid_sim;

/* Makes ready. message (may be NULL) says which parameter or column is missing.
 * DRIVEID_ERR_ARGUMENT: a parameter without value, or a null pointer; _DATA: a column is missing. */
driveid_status driveid_sim_init(driveid_sim *sim, const driveid_model *model, const driveid_sim_record *record, driveid_sim_mode mode,
                                char *message, size_t message_size);

/* State at a row, from the measurement alone: angle, speed (from the speed column, else the slope of the angle), current. */
driveid_status driveid_sim_start(const driveid_sim *sim, size_t row, driveid_sim_state *state);

/* Indices into state.x that an unknown initial state has. Returns their number (<= DRIVEID_X_COUNT). */
uint32_t driveid_sim_free_states(const driveid_sim *sim, uint32_t index[DRIVEID_X_COUNT]);

/* Runs from row `from` to row `to` (exclusive). out[s], where not NULL, receives to - from values of signal s (what the sensor would read),
 * the first one at `from` before any step. On return state belongs to row to - 1.
 * DRIVEID_ERR_NUMERIC where the run left the range of numbers; what was not reached is NaN. */
driveid_status driveid_sim_run(const driveid_sim *sim, size_t from, size_t to, driveid_sim_state *state, double *const out[DRIVEID_SIGNAL_COUNT]);

/* The three above in one: free run from the first row. out as in driveid_sim_run(). */
driveid_status driveid_simulate(const driveid_model *model, const driveid_sim_record *record, double *const out[DRIVEID_SIGNAL_COUNT],
                                char *message, size_t message_size);

/* Bits of the driveid_signal that the simulation predicts. */
uint32_t driveid_sim_outputs(const driveid_sim *sim);

#ifdef __cplusplus
}
#endif
#endif
