/* SPDX-License-Identifier: Apache-2.0 */
/* Effect: one physical phenomenon that a structure may lack, and the catalogue of all that driveid knows.
 *
 * Sign convention: a loss is positive where it opposes positive motion,
 *
 *     J domega/dt = tau - B omega - sum of losses         L di/dt = v - R i - K_e omega - sum of losses
 *
 * An effect with regressors is linear in some parameters once its *shape* parameters are fixed:
 *
 *     loss(t) = sum_c linear[c] * column[c](shape, state(t), memory)
 *
 * driveid_effect_columns() gives the columns, driveid_effect_publish() turns shape and linear values into the published parameters
 * (tau_c, A_N, phi_N ...), driveid_effect_resolve() goes back. Channel and structural effects (delay, compliance, backlash,
 * encoder_eccentricity) have no columns: driveid_simulate() (model.h) is their meaning.
 *
 * C11, no heap, no hidden state: everything here is constant data and pure functions, except the caller's memory[]. */
#ifndef DRIVEID_EFFECT_H
#define DRIVEID_EFFECT_H

#include <stddef.h>
#include <stdint.h>

#include <driveid/status.h>

#ifdef __cplusplus
extern "C" {
#endif

#define DRIVEID_EFFECT_PARAMS_MAX 6
#define DRIVEID_EFFECT_SHAPES_MAX 4
#define DRIVEID_EFFECT_COLUMNS_MAX 4
#define DRIVEID_EFFECT_MEMORY 4
#define DRIVEID_EFFECT_NAMES_MAX 8

typedef enum driveid_effect_kind {
    DRIVEID_EFFECT_TERM = 0,  /* instantaneous loss torque, force or voltage */
    DRIVEID_EFFECT_STATE,     /* loss with a memory of its own */
    DRIVEID_EFFECT_CHANNEL,   /* how a channel is read or applied */
    DRIVEID_EFFECT_DRIFT,     /* a parameter moves with time or temperature */
    DRIVEID_EFFECT_STRUCTURE  /* more masses */
} driveid_effect_kind;

typedef enum driveid_effect_domain { /* bits: the equations in which it stands */
    DRIVEID_EFFECT_MECHANICAL = 1,
    DRIVEID_EFFECT_ELECTRICAL = 2
} driveid_effect_domain;

typedef enum driveid_effect_need { /* bits: what the record and the structure must have */
    DRIVEID_NEED_SPEED = 1,    /* speed, or angle to take it from */
    DRIVEID_NEED_ANGLE = 2,    /* rotary angle, absolute within the turn (linear: position) */
    DRIVEID_NEED_CURRENT = 4,  /* a measured current */
    DRIVEID_NEED_DRIVE = 8,    /* the driving channel of the mechanical equation (current, torque, force, voltage) */
    DRIVEID_NEED_ROTARY = 16,  /* only where there is a turn */
    DRIVEID_NEED_ACCEL = 32
} driveid_effect_need;

/* What the mechanical parameters are measured in: it decides their names and units. */
typedef enum driveid_frame {
    DRIVEID_FRAME_TORQUE = 0,    /* rotary, N m: K_t given, or torque measured:  tau_c_Nm, J_kgm2 */
    DRIVEID_FRAME_FORCE,         /* linear, N:                                   F_c_N, m_kg */
    DRIVEID_FRAME_AMPERE,        /* rotary, per ampere: K_t not given:           tau_c_A, J_As2_rad */
    DRIVEID_FRAME_AMPERE_LINEAR, /* linear, per ampere: K_F not given:           F_c_A, m_As2_m */
    DRIVEID_FRAME_VOLT,          /* rotary, per volt: dc_drive without current:  tau_c_V, J_Vs2_rad */
    DRIVEID_FRAME_COUNT
} driveid_frame;

typedef enum driveid_dimension {
    DRIVEID_DIM_ONE = 0,   /* pure number:      ""                                     */
    DRIVEID_DIM_FORCE,     /* torque or force:  Nm, N, A, A, V                         */
    DRIVEID_DIM_DAMPING,   /* per speed:        Nms_rad, Ns_m, As_rad, As_m, Vs_rad    */
    DRIVEID_DIM_DRAG,      /* per speed^2:      Nms2_rad2, Ns2_m2, As2_rad2, As2_m2, Vs2_rad2 */
    DRIVEID_DIM_STIFFNESS, /* per angle:        Nm_rad, N_m, A_rad, A_m, V_rad         */
    DRIVEID_DIM_INERTIA,   /* per acceleration: kgm2, kg, As2_rad, As2_m, Vs2_rad      */
    DRIVEID_DIM_SPEED,     /* rad_s, m_s                                               */
    DRIVEID_DIM_LENGTH,    /* rad, m                                                   */
    DRIVEID_DIM_PHASE,     /* rad                                                      */
    DRIVEID_DIM_ORDER,     /* rotary: periods per turn (pure number); linear: rad_m    */
    DRIVEID_DIM_DRIVE,     /* of the driving channel: A, V, Nm or N                    */
    DRIVEID_DIM_CURRENT,   /* A */
    DRIVEID_DIM_VOLTAGE,   /* V */
    DRIVEID_DIM_RESISTANCE,/* ohm */
    DRIVEID_DIM_TIME       /* s */
} driveid_dimension;

typedef struct driveid_effect_param {
    const char *symbol;        /* rotary: "tau_c" */
    const char *symbol_linear; /* linear axis: "F_c"; NULL: the same */
    driveid_dimension dimension;
    double lo, hi, typical;    /* bounds and a usual size for a small servo (N m frame) */
    const char *text;          /* one line */
} driveid_effect_param;

/* A shape parameter of the columns: searched, not solved for. */
typedef struct driveid_effect_shape {
    const char *name;
    driveid_dimension dimension;
    double lo, hi, typical;
    uint8_t logarithmic;       /* search it on a logarithmic scale */
    uint8_t whole;             /* usually a whole number (orders) */
} driveid_effect_shape;

/* One instant, SI. Fill what is known, 0 elsewhere. */
typedef struct driveid_effect_state {
    double t_s;        /* since the start of the record */
    double dt_s;       /* since the previous call with the same memory; 0 at the first */
    double angle;      /* rad or m */
    double speed;      /* rad/s or m/s */
    double direction;  /* sign of the speed, -1..1: a fraction where it changed inside the sample; at rest, the side asked for */
    double accel;
    double drive;      /* driving channel: A, V, N m or N */
    double gain;       /* torque per unit of drive (K_t); 1 per ampere, per volt, or where torque is measured */
    double torque;     /* driving torque = gain * drive */
    double voltage_V;
    double current_A;  /* winding current (electrical equation) */
    double resistance_ohm;
    double T_degC;     /* used where has_temperature */
    uint8_t has_temperature;
    uint8_t electrical;/* columns are asked for the voltage equation, not for the torque equation */
} driveid_effect_state;

typedef struct driveid_effect_info driveid_effect_info;
struct driveid_effect_info {
    const char *name;
    const char *equation;
    driveid_effect_kind kind;
    uint8_t domains;   /* driveid_effect_domain bits */
    uint8_t needs;     /* driveid_effect_need bits */
    uint8_t params, shapes, columns, memory;
    uint8_t fixed;     /* bit c: linear[c] is known to be 1 (dead_zone: the column already is a torque) */
    uint8_t repeats;   /* may be used more than once in a model (cogging of several orders) */
    driveid_effect_param param[DRIVEID_EFFECT_PARAMS_MAX];
    driveid_effect_shape shape[DRIVEID_EFFECT_SHAPES_MAX];
    const char *subsumes[DRIVEID_EFFECT_NAMES_MAX];      /* effects that it contains: replace them, do not stand beside */
    const char *confused_with[DRIVEID_EFFECT_NAMES_MAX];
    const char *signature;     /* where its residual shows */
    const char *separated_by;  /* the motion that tells it from what it is confused with */
    const char *literature;
    void (*fill)(const double *shape, const driveid_effect_state *state, double *memory, double *column);
    void (*publish)(const double *shape, const double *linear, double gain, double *param);
    void (*resolve)(const double *param, double gain, double *shape, double *linear);
};

uint32_t driveid_effect_count(void);
const driveid_effect_info *driveid_effect_at(uint32_t index);          /* NULL where out of range */
const driveid_effect_info *driveid_effect_find(const char *name);      /* NULL where unknown */

/* Name with unit ("tau_c_Nm") and unit ("N m") of parameter k in a frame. buffer_size >= 40. drive_unit of DRIVEID_DIM_DRIVE: 'A', 'V', 'N'
 * (force or torque). DRIVEID_ERR_ARGUMENT where k is out of range. */
driveid_status driveid_effect_param_name(const driveid_effect_info *info, uint32_t k, driveid_frame frame, char drive_unit, char *buffer, size_t buffer_size);
driveid_status driveid_effect_param_unit(const driveid_effect_info *info, uint32_t k, driveid_frame frame, char drive_unit, char *buffer, size_t buffer_size);

/* Suffix of a name ("Nms_rad", "" for pure numbers) and unit ("N m s/rad") of a dimension. */
const char *driveid_dimension_suffix(driveid_dimension dimension, driveid_frame frame, char drive_unit);
const char *driveid_dimension_unit(driveid_dimension dimension, driveid_frame frame, char drive_unit);

/* column[info->columns] at one instant; shape[info->shapes]. memory[DRIVEID_EFFECT_MEMORY], zero at the start of a record and after a gap,
 * is advanced over state->dt_s (exactly for a constant speed in between: no step is too long). Effects without columns give DRIVEID_ERR_ARGUMENT. */
driveid_status driveid_effect_columns(const driveid_effect_info *info, const double *shape, const driveid_effect_state *state, double *memory, double *column);

/* (shape, linear) -> published parameters param[info->params], and back. gain as in driveid_effect_state. */
driveid_status driveid_effect_publish(const driveid_effect_info *info, const double *shape, const double *linear, double gain, double *param);
driveid_status driveid_effect_resolve(const driveid_effect_info *info, const double *param, double gain, double *shape, double *linear);

/* Own effects: formulas ----------------------------------------------------------------------------------------------
 *
 * One grammar, parsed once into a fixed array, evaluated without allocation:
 *   numbers, + - * / ^ ( ), functions sin cos tan tanh exp log sqrt abs sign min max pow, the constant pi,
 *   variables t_s theta_rad x_m omega_rad_s v_m_s alpha_rad_s2 a_m_s2 i_A i_q_A tau_Nm F_N v_V T_degC;
 *   every other name is a parameter. Division by zero, log and sqrt of negatives and overflow give 0 at that instant and are counted. */
#define DRIVEID_FORMULA_CODE_MAX 96
#define DRIVEID_FORMULA_DEPTH_MAX 24
#define DRIVEID_FORMULA_PARAMS_MAX 16
#define DRIVEID_FORMULA_NAME_SIZE 40

typedef struct driveid_formula_op { uint8_t code, index; double value; } driveid_formula_op;

typedef struct driveid_formula {
    uint32_t length, params;
    char param[DRIVEID_FORMULA_PARAMS_MAX][DRIVEID_FORMULA_NAME_SIZE];
    uint32_t linear_mask;   /* bit k: the formula is jointly linear in these */
    uint32_t variables;     /* bit v: variable v is used (order of the list above) */
    uint8_t uses_direction; /* sign(speed) occurs: the value at rest depends on the side */
    driveid_formula_op op[DRIVEID_FORMULA_CODE_MAX];
} driveid_formula;

/* DRIVEID_ERR_FORMAT with column and mend in message. */
driveid_status driveid_formula_parse(const char *text, driveid_formula *formula, char *message, size_t message_size);

/* Value with parameter values param[formula->params]; bad counts instants that had no finite value (may be NULL). */
double driveid_formula_value(const driveid_formula *formula, const driveid_effect_state *state, const double *param, uint32_t *bad);

/* column[formula->params]: regressor of each linear parameter (0 for the others); the return is the part that no linear parameter multiplies. */
double driveid_formula_columns(const driveid_formula *formula, const driveid_effect_state *state, const double *param, double *column);

#ifdef __cplusplus
}
#endif
#endif
