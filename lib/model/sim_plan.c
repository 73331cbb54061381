/* SPDX-License-Identifier: Apache-2.0 */
/* From a model and a record to a plan that runs without looking anything up. */
#include <driveid/simulate.h>

#include "model/sim.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static driveid_status complain(char *message, size_t size, driveid_status status, const char *format, const char *what) {
    if (message && size) snprintf(message, size, format, what);
    return status;
}

/* A mechanical parameter: its symbol, with the suffix of its dimension in the model's frame. */
static const driveid_param *by_symbol(const driveid_model *model, const char *symbol, driveid_dimension dimension) {
    char name[DRIVEID_NAME_SIZE];
    const driveid_frame frame = driveid_model_frame(model);
    snprintf(name, sizeof name, "%s_%s", symbol, driveid_dimension_suffix(dimension, frame, 'A'));
    return driveid_model_param(model, name);
}

static int take(const driveid_param *param, double *value, const char **missing) {
    if (!param) return 1;
    if (param->state == DRIVEID_PARAM_UNSET) {
        if (!*missing) *missing = param->name;
        return 0;
    }
    *value = param->value;
    return 1;
}

static void plan_axis(driveid_sim *sim, const driveid_model *model, const char **missing) {
    const int linear = model->structure == DRIVEID_STRUCTURE_LINEAR_AXIS;
    take(by_symbol(model, linear ? "b" : "B", DRIVEID_DIM_DAMPING), &sim->B, missing);
    sim->gain = driveid_model_gain(model);
    if (model->structure == DRIVEID_STRUCTURE_TWO_MASS_AXIS) {
        sim->two_mass = 1;
        take(by_symbol(model, "J_m", DRIVEID_DIM_INERTIA), &sim->J, missing);
        take(by_symbol(model, "J_l", DRIVEID_DIM_INERTIA), &sim->J_l, missing);
        take(by_symbol(model, "k", DRIVEID_DIM_STIFFNESS), &sim->k, missing);
        take(by_symbol(model, "d", DRIVEID_DIM_DAMPING), &sim->d, missing);
    } else {
        take(by_symbol(model, linear ? "m" : "J", DRIVEID_DIM_INERTIA), &sim->J, missing);
    }
}

static void plan_circuit(driveid_sim *sim, const driveid_model *model, const char **missing) {
    take(driveid_model_param(model, "R_ohm"), &sim->R, missing);
    if (sim->dq) {
        take(driveid_model_param(model, "L_d_H"), &sim->L, missing);
        take(driveid_model_param(model, "L_q_H"), &sim->L_q, missing);
        take(driveid_model_param(model, "psi_pm_Vs"), &sim->psi_pm, missing);
        sim->pole_pairs = 1.0;
        take(driveid_model_param(model, "pole_pairs"), &sim->pole_pairs, missing);
    } else {
        take(driveid_model_param(model, "L_H"), &sim->L, missing);
        take(driveid_model_param(model, "K_e_Vs_rad"), &sim->K_e, missing);
    }
}

static void plan_lti(driveid_sim *sim, const driveid_model *model, const char **missing) {
    for (uint32_t k = 0; k < model->params; k++) {
        const driveid_param *p = &model->param[k];
        if (p->name[0] == 'a') take(p, &sim->lti_a[sim->lti_n++], missing);
        else take(p, &sim->lti_b[sim->lti_m++], missing);
    }
    sim->lti_m -= 1;
}

/* ---- effects ---- */

static void add_bristle(driveid_sim *sim, const driveid_effect_use *use, const double *p, uint8_t slot) {
    driveid_sim_bristle *b = &sim->bristle[sim->bristles++];
    *b = (driveid_sim_bristle){.force = p[0], .level = 1.0, .omega_s = 1.0, .slot = slot};
    if (strcmp(use->name, "hysteresis") == 0) {
        b->length = p[1];
    } else {
        b->level = p[0] > 0.0 ? p[1] / p[0] : 1.0;
        b->omega_s = p[2];
        b->length = p[3] > 0.0 ? p[0] / p[3] : 1e-3;
        b->damping_s = p[3] > 0.0 ? p[4] / p[3] : 0.0;
    }
    if (!(b->length > 1e-9)) b->length = 1e-9;
    if (!(b->level > 0.05)) b->level = 0.05;
    if (!(fabs(b->omega_s) > 1e-9)) b->omega_s = 1e-9;
}

static void add_two_mass(driveid_sim *sim, const double *p) {
    const double whole = sim->J;
    sim->two_mass = 1;
    sim->J_l = fmin(fmax(p[0], 0.001 * whole), 0.99 * whole);
    sim->J = whole - sim->J_l;
    sim->k = p[1];
    sim->d = p[2];
}

static int model_has(const driveid_model *model, const char *name) {
    for (uint32_t e = 0; e < model->effects; e++)
        if (strcmp(model->effect[e].name, name) == 0) return 1;
    return 0;
}

/* Effects that are not a sum of columns. Returns 1 where it was one of them. */
static int plan_special(driveid_sim *sim, const driveid_model *model, const driveid_effect_use *use, const double *p, uint8_t slot) {
    const char *n = use->name;
    if (strcmp(n, "lugre") == 0 || strcmp(n, "hysteresis") == 0) {
        if (sim->axis) add_bristle(sim, use, p, slot);
    } else if (strcmp(n, "compliance") == 0) {
        if (sim->axis) add_two_mass(sim, p);
    } else if (strcmp(n, "backlash") == 0) {
        sim->gap = fabs(p[0]);
        if (sim->axis && sim->structure != DRIVEID_STRUCTURE_TWO_MASS_AXIS && !model_has(model, "compliance")) add_two_mass(sim, p + 1);
    } else if (strcmp(n, "delay") == 0) {
        /* with a voltage in the record the dead time lies between command and voltage, before the current that moves the axis */
        const int voltage = sim->structure == DRIVEID_STRUCTURE_DC_DRIVE || sim->structure == DRIVEID_STRUCTURE_DC_CIRCUIT || sim->structure == DRIVEID_STRUCTURE_PMSM_DRIVE;
        if (!voltage || sim->circuit || sim->lumped_circuit) sim->delay_s = fmax(0.0, p[0]);
    } else if (strcmp(n, "encoder_eccentricity") == 0) {
        sim->ecc_a = p[0];
        sim->ecc_phi = p[1];
    } else if (strcmp(n, "inertia_change") == 0) {
        sim->dJ = p[0];
        sim->t_step_s = p[1];
    } else if (strcmp(n, "dead_time_voltage") == 0) {
        sim->V_d = fmax(0.0, p[0]);
    } else if (strcmp(n, "resistance_drift") == 0) {
        sim->dR = p[0];
        sim->T_th_s = fmax(1e-3, p[1]);
        sim->resistance_slot = slot;
    } else if (strcmp(n, "current_offset") == 0) {
        sim->i_0 = p[0];
        return 0; /* it also loads the axis */
    } else if (strcmp(n, "dead_zone") == 0 && sim->circuit && !sim->dq) {
        sim->u_d = fabs(p[0]);
    } else {
        return 0;
    }
    return 1;
}

static int depends_on_direction(const driveid_effect_info *info) {
    static const char *const names[] = {"coulomb", "stribeck", "asymmetric_friction", "load_dependent_friction", "eccentric_friction", "friction_drift"};
    for (size_t k = 0; k < sizeof names / sizeof names[0]; k++)
        if (strcmp(info->name, names[k]) == 0) return 1;
    return 0;
}

static driveid_status plan_own(driveid_sim *sim, const driveid_effect_use *use, const double *p, uint8_t slot, char *message, size_t size) {
    driveid_sim_term *term = &sim->term[sim->terms];
    memset(term, 0, sizeof *term);
    const driveid_status s = driveid_formula_parse(use->formula, &term->formula, message, size);
    if (s) return s;
    term->electrical = strcmp(use->adds_to, "v_V") == 0 && !sim->lumped_circuit;
    term->slot = slot;
    memcpy(term->param, p, sizeof term->param);
    if (term->electrical ? !sim->circuit : !sim->axis) return DRIVEID_OK;
    if (term->formula.uses_direction) sim->has_direction = 1;
    sim->terms++;
    return DRIVEID_OK;
}

static void plan_columns(driveid_sim *sim, const driveid_effect_info *info, const double *p, uint8_t slot) {
    if (!sim->axis || !(info->domains & DRIVEID_EFFECT_MECHANICAL) || !info->fill) return;
    if (strcmp(info->name, "current_offset") == 0 && sim->mode == DRIVEID_SIM_WHOLE && sim->circuit) return; /* the simulated current is the true one */
    driveid_sim_term *term = &sim->term[sim->terms++];
    memset(term, 0, offsetof(driveid_sim_term, formula));
    term->info = info;
    term->slot = slot;
    info->resolve(p, sim->gain, term->shape, term->linear);
    if (depends_on_direction(info)) sim->has_direction = 1;
    if (strcmp(info->name, "cogging") == 0 || strcmp(info->name, "torque_ripple") == 0 || strcmp(info->name, "eccentric_friction") == 0) sim->order_max = fmax(sim->order_max, fabs(term->shape[0]));
    if (strcmp(info->name, "gravity_unbalance") == 0) sim->order_max = fmax(sim->order_max, 1.0);
}

static driveid_status plan_effects(driveid_sim *sim, const driveid_model *model, const char **missing, char *message, size_t size) {
    for (uint32_t e = 0; e < model->effects; e++) {
        const driveid_effect_use *use = &model->effect[e];
        const driveid_effect_info *info = driveid_effect_find(use->name);
        double p[DRIVEID_PARAMS_MAX] = {0};
        for (uint32_t k = 0; k < use->params; k++) take(&use->param[k], &p[k], missing);
        if (*missing) return DRIVEID_OK;
        if (!info) {
            const driveid_status s = plan_own(sim, use, p, (uint8_t)e, message, size);
            if (s) return s;
        } else if (!plan_special(sim, model, use, p, (uint8_t)e)) {
            plan_columns(sim, info, p, (uint8_t)e);
        }
    }
    return DRIVEID_OK;
}

/* ---- channels of the record ---- */

static const double *first_of(const driveid_sim_record *record, const driveid_signal *list, size_t count) {
    for (size_t k = 0; k < count; k++)
        if (record->signal[list[k]]) return record->signal[list[k]];
    return NULL;
}

/* A measured torque or force comes before a current; then there is no gain. */
static const double *measured_or(driveid_sim *sim, driveid_signal signal, const double *current) {
    if (!sim->record.signal[signal]) return current;
    sim->gain = 1.0;
    return sim->record.signal[signal];
}

static const double *mechanical_drive(driveid_sim *sim, const driveid_model *model) {
    const int dq = model->structure == DRIVEID_STRUCTURE_PMSM_DRIVE;
    const driveid_signal current[] = {dq ? DRIVEID_SIGNAL_I_Q_A : DRIVEID_SIGNAL_I_A, dq ? DRIVEID_SIGNAL_I_A : DRIVEID_SIGNAL_I_Q_A}, voltage[] = {DRIVEID_SIGNAL_V_V};
    switch (driveid_model_frame(model)) {
    case DRIVEID_FRAME_VOLT: return first_of(&sim->record, voltage, 1);
    case DRIVEID_FRAME_FORCE: return measured_or(sim, DRIVEID_SIGNAL_F_N, driveid_model_param(model, "K_F_N_A") ? first_of(&sim->record, current, 2) : NULL);
    case DRIVEID_FRAME_TORQUE: {
        const int knows_gain = model->structure == DRIVEID_STRUCTURE_PMSM_DRIVE || model->structure == DRIVEID_STRUCTURE_DC_DRIVE || driveid_model_param(model, "K_t_Nm_A");
        return measured_or(sim, DRIVEID_SIGNAL_TAU_NM, knows_gain ? first_of(&sim->record, current, 2) : NULL);
    }
    default: return first_of(&sim->record, current, 2);
    }
}

static driveid_status plan_channels(driveid_sim *sim, const driveid_model *model, char *message, size_t size) {
    const driveid_signal speed[] = {DRIVEID_SIGNAL_OMEGA_RAD_S, DRIVEID_SIGNAL_V_M_S};
    const driveid_sim_record *r = &sim->record;
    if (model->structure == DRIVEID_STRUCTURE_LTI) sim->drive = r->signal[DRIVEID_SIGNAL_U];
    else if (sim->dq && sim->circuit) sim->drive = r->signal[DRIVEID_SIGNAL_V_Q_V], sim->drive_d = r->signal[DRIVEID_SIGNAL_V_D_V];
    else if (sim->circuit) sim->drive = r->signal[DRIVEID_SIGNAL_V_V];
    else sim->drive = mechanical_drive(sim, model), sim->drive_d = sim->dq ? r->signal[DRIVEID_SIGNAL_I_D_A] : NULL;
    if (!sim->drive || (sim->dq && sim->circuit && !sim->drive_d))
        return complain(message, size, DRIVEID_ERR_DATA, "the record has no column that drives a %s in this model's units", driveid_structure_name(model->structure));
    if (sim->circuit && !sim->axis) {
        sim->speed_in = first_of(r, speed, 2);
        if (!sim->speed_in) return complain(message, size, DRIVEID_ERR_DATA, "the circuit of %s needs the speed: record omega_rad_s or theta_rad", driveid_structure_name(model->structure));
    }
    return DRIVEID_OK;
}

/* ---- substep ---- */

static double longest_substep(const driveid_sim *sim) {
    double h = INFINITY;
    if (sim->axis && sim->B > 0.0) h = fmin(h, 0.3 * sim->J / sim->B);
    if (sim->two_mass && sim->axis) h = fmin(h, 0.3 / sqrt(sim->k * (1.0 / sim->J + 1.0 / sim->J_l) + 1e-12));
    for (uint32_t k = 0; k < sim->bristles; k++) h = fmin(h, 1.0 / sqrt(fabs(sim->bristle[k].force) / (sim->bristle[k].length * sim->J) + 1e-12));
    if (sim->circuit && sim->dq) h = fmin(h, 0.25 * fmin(sim->L, sim->L_q) / fmax(sim->R, 1e-9));
    if (sim->circuit && !sim->dq) h = fmin(h, 0.5 * sim->L / fmax(sim->R, 1e-9));
    if (sim->circuit && sim->axis && !sim->dq) h = fmin(h, 0.2 / sqrt(fabs(sim->K_e * sim->gain) / (sim->J * fmax(sim->L, 1e-9)) + 1e-12));
    return h;
}

driveid_status driveid_sim_init(driveid_sim *sim, const driveid_model *model, const driveid_sim_record *record, driveid_sim_mode mode, char *message, size_t message_size) {
    if (message && message_size) message[0] = 0;
    if (!sim || !model || !record || !record->t_s || record->rows < 2) return DRIVEID_ERR_ARGUMENT;
    memset(sim, 0, offsetof(driveid_sim, term));
    sim->structure = model->structure;
    sim->mode = mode;
    sim->record = *record;
    sim->dq = model->structure == DRIVEID_STRUCTURE_PMSM_DRIVE;
    const int has_circuit = model->structure == DRIVEID_STRUCTURE_DC_CIRCUIT || model->structure == DRIVEID_STRUCTURE_DC_DRIVE || sim->dq;
    sim->lumped_circuit = driveid_model_frame(model) == DRIVEID_FRAME_VOLT;
    sim->circuit = has_circuit && !sim->lumped_circuit && mode != DRIVEID_SIM_MECHANICAL;
    sim->axis = model->structure != DRIVEID_STRUCTURE_DC_CIRCUIT && model->structure != DRIVEID_STRUCTURE_LTI && (mode != DRIVEID_SIM_ELECTRICAL || sim->lumped_circuit);
    const char *missing = NULL;
    if (sim->structure == DRIVEID_STRUCTURE_LTI) plan_lti(sim, model, &missing);
    if (sim->axis) plan_axis(sim, model, &missing);
    if (sim->circuit || sim->dq) plan_circuit(sim, model, sim->circuit ? &missing : &(const char *){""});
    driveid_status s = plan_channels(sim, model, message, message_size);
    if (s) return s;
    if (!missing) s = plan_effects(sim, model, &missing, message, message_size);
    if (missing) return complain(message, message_size, DRIVEID_ERR_ARGUMENT, "parameter %s has no value yet: fit the model first, or give it", missing);
    if (s) return s;
    if (sim->axis && !(sim->J > 0.0)) return complain(message, message_size, DRIVEID_ERR_ARGUMENT, "inertia of the %s must be positive to simulate", driveid_structure_name(sim->structure));
    sim->substep_s = longest_substep(sim);
    return DRIVEID_OK;
}
