/* SPDX-License-Identifier: Apache-2.0 */
/* Model: a structure (known equations of a drive) plus the effects that were added to it, with parameter values.
 *
 * The same definition in C, in the TOML model file (model_file.h), in Python and on the screen. */
#ifndef DRIVEID_MODEL_H
#define DRIVEID_MODEL_H

#include <stddef.h>
#include <stdint.h>

#include <driveid/effect.h>
#include <driveid/estimate.h>
#include <driveid/regression.h>
#include <driveid/sample.h>
#include <driveid/status.h>

#ifdef __cplusplus
extern "C" {
#endif

#define DRIVEID_NAME_SIZE 40
#define DRIVEID_PARAMS_MAX 16        /* per structure, or per effect */
#define DRIVEID_MODEL_EFFECTS_MAX 12

typedef enum driveid_structure {
    DRIVEID_STRUCTURE_RIGID_AXIS = 0,
    DRIVEID_STRUCTURE_LINEAR_AXIS,
    DRIVEID_STRUCTURE_TWO_MASS_AXIS,
    DRIVEID_STRUCTURE_DC_CIRCUIT,
    DRIVEID_STRUCTURE_DC_DRIVE,
    DRIVEID_STRUCTURE_PMSM_DRIVE,
    DRIVEID_STRUCTURE_LTI,
    DRIVEID_STRUCTURE_COUNT
} driveid_structure;

typedef enum driveid_param_state {
    DRIVEID_PARAM_UNSET = 0,  /* no value yet: fit finds it */
    DRIVEID_PARAM_FREE = 1,   /* has a value, fit may change it */
    DRIVEID_PARAM_GIVEN = 2   /* the user's: fit never changes it */
} driveid_param_state;

typedef struct driveid_param {
    char name[DRIVEID_NAME_SIZE]; /* symbol and unit: "J_kgm2" */
    char unit[16];                /* "kg m^2" */
    driveid_param_state state;
    double value, lo, hi;         /* 95 % interval; lo = hi = value where given or unknown */
} driveid_param;

typedef struct driveid_effect_use {
    char name[DRIVEID_NAME_SIZE]; /* canonical name (effect.h), or an own one with a formula */
    char formula[160];            /* own effects only, else "" */
    char adds_to[16];             /* own effects only: "tau_Nm", "F_N", "v_V" */
    uint32_t params;
    driveid_param param[DRIVEID_PARAMS_MAX];
} driveid_effect_use;

typedef struct driveid_model {
    driveid_structure structure;
    uint32_t params;
    driveid_param param[DRIVEID_PARAMS_MAX];
    uint32_t effects;
    driveid_effect_use effect[DRIVEID_MODEL_EFFECTS_MAX];
} driveid_model;

const char *driveid_structure_name(driveid_structure structure);
driveid_status driveid_structure_from_name(const char *name, driveid_structure *structure);

/* Empty model of a structure: every parameter UNSET. DRIVEID_ERR_ARGUMENT where structure is unknown. */
driveid_status driveid_model_init(driveid_model *model, driveid_structure structure);

/* Set a parameter as given; names that only exist as given ("K_t_Nm_A", "K_F_N_A", "pole_pairs") are accepted.
 * DRIVEID_ERR_ARGUMENT where the structure has no such parameter. */
driveid_status driveid_model_give(driveid_model *model, const char *name, double value);

/* Parameter of the structure by name; NULL where it has none. */
const driveid_param *driveid_model_param(const driveid_model *model, const char *name);

/* What the mechanical parameters are measured in (effect.h). The names say it: "J_kgm2", "J_As2_rad" (per ampere, K_t not given),
 * "J_Vs2_rad" (dc_drive without current). A new model is in N m or N; fit moves it to the frame that the record and what is given allow. */
driveid_frame driveid_model_frame(const driveid_model *model);

/* Rename the mechanical parameters, those of effects too, to a frame. DRIVEID_ERR_CONFIG, and nothing changed, where a given
 * value stands in another frame (its number would be wrong there); reason names it. */
driveid_status driveid_model_set_frame(driveid_model *model, driveid_frame frame, char *reason, size_t reason_size);

/* Torque or force per unit of current: K_t or K_F where given, K_e of a dc_drive where not (they are one number in SI), 3/2 pole_pairs psi_pm of a
 * pmsm_drive, else 1. A measured torque or force comes before a current. */
double driveid_model_gain(const driveid_model *model);

/* Unit of the driving channel for names of effects: 'A', 'V', or 'N' where torque or force is measured. */
char driveid_model_drive_unit(const driveid_model *model);

/* One effect more, parameters UNSET, named in the model's frame. formula and adds_to: NULL for effects of the catalogue.
 * DRIVEID_ERR_ARGUMENT: unknown effect, or one that the structure cannot have; _CAPACITY: no room; _FORMAT: the formula. reason says which and the mend. */
driveid_status driveid_model_add(driveid_model *model, const char *effect, const char *formula, const char *adds_to, char *reason, size_t reason_size);

/* On-line form -------------------------------------------------------------------------------------------------- */

#define DRIVEID_ONLINE_DELAY 4        /* samples between a reading and its use where speed comes from the angle */
#define DRIVEID_ONLINE_RING (2 * DRIVEID_ONLINE_DELAY + 1)

#define DRIVEID_ONLINE_LOSSES 6       /* effects of the model that run with the values of its file */
#define DRIVEID_ONLINE_PAST 64        /* readings behind a dead time */

/* Private: an effect that runs with its values: shape and linear parameters, or an own formula. */
typedef struct driveid_online_loss {
    uint8_t effect;                   /* of the model */
    uint8_t own;                      /* 1: a formula; its parameters stand in linear[] */
    uint8_t electrical;
    double shape[DRIVEID_EFFECT_SHAPES_MAX];
    double linear[DRIVEID_FORMULA_PARAMS_MAX];
    double memory[DRIVEID_EFFECT_MEMORY];
} driveid_online_loss;

/* Private: what fills a channel of the regression. */
typedef struct driveid_online_channel {
    uint8_t kind;                     /* signal, product of two, speed times signal, one, sign of speed, losses, delayed signal */
    uint8_t a, b;                     /* driveid_signal */
} driveid_online_channel;

/* A model made ready for an on-line estimator: the regression, how to fill its channels, and how to come back.
 * rigid_axis, linear_axis, dc_circuit, dc_drive, pmsm_drive and lti. Parameters that the model has as given are used, the others are estimated, also
 * those of the effects coulomb and constant_load. Other effects of the catalogue with columns, own formulas, delay and inertia_change run with
 * the values that the model file has for them; what cannot run on line (two masses) is named in missing. Plain data: a copy is a snapshot. */
typedef struct driveid_online {
    driveid_model model;
    driveid_regression regression;
    uint32_t present;                                    /* signals that the samples must carry (driveid_signal bits) */
    uint32_t physical;                                   /* number of physical parameters it can give */
    char physical_name[DRIVEID_THETA_MAX][DRIVEID_NAME_SIZE];
    char physical_unit[DRIVEID_THETA_MAX][16];
    char missing[256];                                   /* parameters that cannot be had from these signals, and what to record; "" if none */
    int64_t t_ns;                                        /* stamp that belongs to the channels just filled: pass it to update */
    int8_t mechanical;                                   /* equation of the torque or force balance, -1: none */
    uint8_t drive;                                       /* driveid_signal that drives it */
    double drive_gain;                                   /* torque or force per unit of it */
    /* private */
    uint8_t losses, has_loss;                            /* has_loss: bit 0 mechanical, bit 1 electrical */
    driveid_online_loss loss[DRIVEID_ONLINE_LOSSES];
    driveid_formula formula;                             /* of the one own effect */
    double delay_s;                                      /* of the driving signal */
    double past[DRIVEID_ONLINE_PAST];                    /* its readings, newest at past_next */
    int64_t past_ns[DRIVEID_ONLINE_PAST];
    uint8_t past_next, past_fill;
    driveid_online_channel filler[DRIVEID_CHANNELS_MAX];
    uint8_t uses_speed, motion, delayed, rest_matters, ring_fill; /* motion: the signal that speed comes from */
    driveid_sample ring[DRIVEID_ONLINE_RING];            /* newest first */
    double speed, last_speed, noise;
    double dt_s;                                         /* slow mean of the sample time */
} driveid_online;

/* signals: bits of the driveid_signal that will be present. DRIVEID_ERR_CONFIG where nothing can be identified (reason says why). */
driveid_status driveid_online_init(driveid_online *online, const driveid_model *model, uint32_t signals,
                                   char *reason, size_t reason_size);

/* One signal by itself, for the method "frequency": regression of driveid_frequency_regression(), physical parameters f1_Hz, amplitude1_A, ... (the
 * unit is the signal's). There is no model behind it: driveid_online.model is empty. DRIVEID_ERR_ARGUMENT: a regression of more than one channel. */
driveid_status driveid_online_sinusoids(driveid_online *online, const driveid_regression *regression, driveid_signal signal);

/* How a signal behaves between stamps (default: DRIVEID_HOLD_FIRST), before the estimator is configured.
 * DRIVEID_ERR_ARGUMENT where the regression does not use the signal. */
driveid_status driveid_online_hold(driveid_online *online, driveid_signal signal, driveid_hold hold);

/* Largest magnitude of each channel where signal s stays within +- signal_range[s] (DRIVEID_SIGNAL_COUNT of them, 0: not declared), for q31; 0 where
 * it does not follow (speed out of an angle needs a range of omega_rad_s). */
void driveid_online_ranges(const driveid_online *online, const double *signal_range, double *channel_range);

/* Fill channel[regression.channels] from a sample and set online->t_ns, the stamp that belongs to them.
 *   DRIVEID_OK       give channel and online->t_ns to driveid_estimator_update()
 *   DRIVEID_NOT_YET  a needed signal is absent, or the speed filter (2 DRIVEID_ONLINE_DELAY samples) is not full yet
 *   DRIVEID_FROZEN   the drive rests and the model has Coulomb friction, which is undetermined at rest: do not update; the silence
 *                    that the estimator then sees restarts its filters and keeps what it learnt
 *   DRIVEID_ERR_VALUE, DRIVEID_ERR_TIME  the sample was ignored */
driveid_status driveid_online_channels(driveid_online *online, const driveid_sample *sample, double *channel);

/* Samples are known to be lost before the next one: speed is not taken across the hole. */
void driveid_online_gap(driveid_online *online);

/* theta -> physical parameters with propagated 95 % intervals (delta method on the covariance). out[physical].
 * Inductances: where the voltage is held or averaged over a sample, readings of the current see the kinks between them only through
 * theta_L = R dt/2 coth(R dt/(2 L)); L comes out of that (2 % at dt = L/(2 R), nothing at dt << L/R). Everything else is theta itself. */
driveid_status driveid_online_physical(const driveid_online *online, const driveid_estimate *estimate,
                                       driveid_param *out, uint32_t *valid_mask);

#ifdef __cplusplus
}
#endif
#endif
