/* SPDX-License-Identifier: Apache-2.0 */
/* From a model to the regression that an on-line estimator works on. Every structure here is linear in its physical
 * parameters once the given ones are put in, so theta is the list of parameters itself. */
#include <driveid/effect.h>
#include <driveid/model.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "model/online.h"

#define SIGN_ERROR 3e-4    /* of the torque: when the friction turned, between stamps */
#define CIRCUIT_ERROR 5e-4 /* of the voltage: kinks of the current between stamps */

typedef struct build {
    driveid_online *online;
    uint32_t signals;
    int failed; /* a term, channel or parameter too many */
} build;

static void note_missing(build *b, const char *text) {
    char *missing = b->online->missing;
    const size_t used = strlen(missing);
    snprintf(missing + used, sizeof b->online->missing - used, "%s%s", used ? "; " : "", text);
}

static int has(const build *b, driveid_signal s) { return (b->signals >> s) & 1; }

static int channel_of(build *b, uint8_t kind, driveid_signal first, driveid_signal second) {
    driveid_regression *r = &b->online->regression;
    for (int c = 0; c < r->channels; c++) {
        const driveid_online_channel *f = &b->online->filler[c];
        if (f->kind == kind && f->a == first && f->b == second) return c;
    }
    if (r->channels >= DRIVEID_CHANNELS_MAX) {
        b->failed = 1;
        return 0;
    }
    b->online->filler[r->channels] = (driveid_online_channel){kind, (uint8_t)first, (uint8_t)second};
    if (kind == ONLINE_SIGNAL || kind == ONLINE_PRODUCT || kind == ONLINE_SPEED_TIMES || kind == ONLINE_DELAYED) b->online->present |= UINT32_C(1) << first;
    if (kind == ONLINE_PRODUCT) b->online->present |= UINT32_C(1) << second;
    r->hold[r->channels] = kind == ONLINE_SIGN ? DRIVEID_HOLD_AVERAGE : DRIVEID_HOLD_FIRST;
    return r->channels++;
}

static int signal_channel(build *b, driveid_signal s) { return channel_of(b, ONLINE_SIGNAL, s, s); }

static void put_term(build *b, int equation, int channel, int derivative, int param, double factor) {
    driveid_regression *r = &b->online->regression;
    if (factor == 0) return; /* a parameter given as zero: its term is not there */
    if (r->terms >= DRIVEID_TERMS_MAX) {
        b->failed = 1;
        return;
    }
    r->term[r->terms++] = (driveid_term){(uint8_t)equation, (uint8_t)channel, (uint8_t)derivative, (int8_t)param, factor};
    if (equation >= r->equations) r->equations = (uint8_t)(equation + 1);
}

static void known(build *b, int equation, int channel, int derivative, double factor) {
    put_term(b, equation, channel, derivative, DRIVEID_TERM_KNOWN, factor);
}

static int theta_of(build *b, const driveid_param *param, int may_be_zero) {
    driveid_online *o = b->online;
    for (uint32_t i = 0; i < o->physical; i++)
        if (strcmp(o->physical_name[i], param->name) == 0) return (int)i;
    if (o->physical >= DRIVEID_THETA_MAX) {
        b->failed = 1;
        return 0;
    }
    memcpy(o->physical_name[o->physical], param->name, sizeof param->name);
    memcpy(o->physical_unit[o->physical], param->unit, sizeof param->unit);
    if (may_be_zero) o->regression.may_be_zero |= (uint16_t)(1u << o->physical);
    o->regression.params++;
    return (int)o->physical++;
}

/* factor * parameter * d^k channel; a given parameter becomes part of the factor. */
static void term(build *b, int equation, int channel, int derivative, const driveid_param *param, int may_be_zero, double factor) {
    if (!param) {
        b->failed = 1;
        return;
    }
    if (param->state == DRIVEID_PARAM_GIVEN) known(b, equation, channel, derivative, factor * param->value);
    else put_term(b, equation, channel, derivative, theta_of(b, param, may_be_zero), factor);
}

static const driveid_param *named(const build *b, const char *name) { return driveid_model_param(&b->online->model, name); }

static const driveid_param *either(const build *b, const char *const *names) {
    for (; *names; names++) {
        const driveid_param *p = named(b, *names);
        if (p) return p;
    }
    return NULL;
}

/* The signal that motion comes from, and how often it must be differentiated for speed; -1: none. */
static int motion(build *b, int linear, driveid_signal *signal) {
    const driveid_signal angle = linear ? DRIVEID_SIGNAL_X_M : DRIVEID_SIGNAL_THETA_RAD;
    const driveid_signal speed = linear ? DRIVEID_SIGNAL_V_M_S : DRIVEID_SIGNAL_OMEGA_RAD_S;
    *signal = has(b, angle) ? angle : speed;
    return has(b, angle) ? 1 : has(b, speed) ? 0 : -1;
}

static void need_speed(build *b, driveid_signal s, int derivative) {
    b->online->uses_speed = 1;
    b->online->motion = (uint8_t)s;
    b->online->present |= UINT32_C(1) << s;
    b->online->delayed = derivative > 0 ? DRIVEID_ONLINE_DELAY : 0;
}

/* A loss that depends on the direction is undetermined while the drive rests. */
static int turns_at_rest(const driveid_effect_info *info) {
    return !info || ((info->needs & DRIVEID_NEED_SPEED) && strcmp(info->name, "quadratic_drag") != 0);
}

static int is_electrical(const driveid_effect_use *use) {
    const driveid_effect_info *info = driveid_effect_find(use->name);
    return info && !(info->domains & DRIVEID_EFFECT_MECHANICAL);
}

/* An effect that runs with the values of the model file. */
static void known_effect(build *b, uint32_t k, int equation, int channel, driveid_signal s, int speed_derivative) {
    driveid_online *o = b->online;
    double value = 0;
    char why[160];
    switch (online_enter_effect(o, k, &value, why, sizeof why)) {
    case ONLINE_PART_DELAY: o->delay_s += value; break;
    case ONLINE_PART_INERTIA: known(b, equation, channel, speed_derivative + 1, value); break;
    case ONLINE_PART_LOSS:
        need_speed(b, s, speed_derivative);
        o->rest_matters |= (uint8_t)turns_at_rest(driveid_effect_find(o->model.effect[k].name));
        if (!(o->has_loss & 1)) known(b, equation, channel_of(b, ONLINE_LOSS, 0, 0), 0, 1);
        o->has_loss |= 1;
        break;
    default: note_missing(b, why);
    }
}

/* Inertia, damping, and the effects of the mechanical equation, on its left; the driving signal on its right. gain: its factor. */
static void mechanical(build *b, int equation, driveid_signal s, int speed_derivative, driveid_signal drive, double gain) {
    static const char *const inertia[] = {"J_kgm2", "J_As2_rad", "J_Vs2_rad", "m_kg", "m_As2_m", NULL};
    static const char *const damping[] = {"B_Nms_rad", "B_As_rad", "B_Vs_rad", "b_Ns_m", "b_As_m", NULL};
    driveid_online *o = b->online;
    const int c = signal_channel(b, s);
    o->mechanical = (int8_t)equation;
    o->drive = (uint8_t)drive;
    o->drive_gain = gain;
    term(b, equation, c, speed_derivative + 1, either(b, inertia), 0, 1);
    term(b, equation, c, speed_derivative, either(b, damping), 1, 1);
    for (uint32_t i = 0; i < o->model.effects; i++) {
        const driveid_effect_use *use = &o->model.effect[i];
        if (strcmp(use->name, "coulomb") == 0) {
            need_speed(b, s, speed_derivative);
            o->rest_matters = 1;
            o->regression.model_error = fmax(o->regression.model_error, SIGN_ERROR);
            term(b, equation, channel_of(b, ONLINE_SIGN, 0, 0), 0, &use->param[0], 1, 1);
        } else if (strcmp(use->name, "constant_load") == 0) {
            term(b, equation, channel_of(b, ONLINE_ONE, 0, 0), 0, &use->param[0], 1, 1);
        } else if (!is_electrical(use)) {
            known_effect(b, i, equation, c, s, speed_derivative);
        }
    }
}

/* The driving signal of the mechanical equation, through the dead time where the model has one. */
static int drive_channel(build *b) {
    const driveid_signal s = (driveid_signal)b->online->drive;
    return b->online->delay_s > 0 ? channel_of(b, ONLINE_DELAYED, s, s) : signal_channel(b, s);
}

static driveid_status refuse(char *reason, size_t size, const char *text) {
    if (reason && size) snprintf(reason, size, "%s", text);
    return DRIVEID_ERR_CONFIG;
}

static driveid_status axis(build *b, int linear, char *reason, size_t size) {
    const driveid_signal direct = linear ? DRIVEID_SIGNAL_F_N : DRIVEID_SIGNAL_TAU_NM;
    const driveid_signal current = has(b, DRIVEID_SIGNAL_I_Q_A) ? DRIVEID_SIGNAL_I_Q_A : DRIVEID_SIGNAL_I_A;
    const driveid_param *gain = named(b, linear ? "K_F_N_A" : "K_t_Nm_A");
    driveid_signal s;
    const int speed = motion(b, linear, &s);
    if (speed < 0) return refuse(reason, size, linear ? "record x_m or v_m_s" : "record theta_rad or omega_rad_s");
    if (!has(b, direct) && !has(b, current)) return refuse(reason, size, linear ? "record i_A (or i_q_A) or F_N" : "record i_A (or i_q_A) or tau_Nm");
    if (!has(b, direct) && !gain) {
        const driveid_status status = driveid_model_set_frame(&b->online->model, linear ? DRIVEID_FRAME_AMPERE_LINEAR : DRIVEID_FRAME_AMPERE, reason, size);
        if (status) return status;
        note_missing(b, linear ? "m_kg, b_Ns_m: only per ampere; give K_F_N_A or record F_N" : "J_kgm2, B_Nms_rad: only per ampere; give K_t_Nm_A or record tau_Nm");
    }
    const double per_drive = has(b, direct) || !gain ? 1 : gain->value;
    mechanical(b, 0, s, speed, has(b, direct) ? direct : current, per_drive);
    known(b, 0, drive_channel(b), 0, -per_drive);
    return DRIVEID_OK;
}

/* Effects of the voltage equation alone; dc_drive meets them again among those of its mechanical equation. */
static void electrical_effects(build *b) {
    driveid_online *o = b->online;
    for (uint32_t i = 0; i < o->model.effects; i++) {
        double value = 0;
        char why[160];
        if (!is_electrical(&o->model.effect[i])) continue;
        const online_part part = online_enter_effect(o, i, &value, why, sizeof why);
        if (part == ONLINE_PART_NONE) note_missing(b, why);
        if (part != ONLINE_PART_LOSS) continue;
        if (!(o->has_loss & 2)) known(b, 0, channel_of(b, ONLINE_LOSS, 1, 0), 0, 1);
        o->has_loss |= 2;
    }
}

static driveid_status circuit(build *b, char *reason, size_t size) {
    driveid_signal s;
    const int speed = motion(b, 0, &s);
    if (!has(b, DRIVEID_SIGNAL_V_V) || !has(b, DRIVEID_SIGNAL_I_A)) return refuse(reason, size, "record v_V and i_A");
    const int i = signal_channel(b, DRIVEID_SIGNAL_I_A);
    term(b, 0, i, 0, named(b, "R_ohm"), 0, 1);
    term(b, 0, i, 1, named(b, "L_H"), 0, 1);
    if (speed >= 0) term(b, 0, signal_channel(b, s), speed, named(b, "K_e_Vs_rad"), 1, 1);
    else note_missing(b, "K_e_Vs_rad: record omega_rad_s or theta_rad (without it the drive must stand still)");
    known(b, 0, signal_channel(b, DRIVEID_SIGNAL_V_V), 0, -1);
    electrical_effects(b);
    b->online->regression.bandwidth_rad_s = 300;
    b->online->regression.model_error = CIRCUIT_ERROR;
    return DRIVEID_OK;
}

/* Voltage to speed in one equation, inductance neglected: v = J' domega/dt + B' omega (+ friction in volts). */
static driveid_status lumped(build *b, driveid_signal s, int speed, char *reason, size_t size) {
    const driveid_status status = driveid_model_set_frame(&b->online->model, DRIVEID_FRAME_VOLT, reason, size);
    if (status) return status;
    note_missing(b, "R_ohm, L_H, K_e_Vs_rad, J_kgm2, B_Nms_rad: without current only the voltage-to-speed model; record i_A");
    mechanical(b, 0, s, speed, DRIVEID_SIGNAL_V_V, 1);
    known(b, 0, drive_channel(b), 0, -1);
    return DRIVEID_OK;
}

static driveid_status dc_drive(build *b, char *reason, size_t size) {
    driveid_signal s;
    const int speed = motion(b, 0, &s);
    if (speed < 0) return refuse(reason, size, "record theta_rad or omega_rad_s");
    if (!has(b, DRIVEID_SIGNAL_V_V)) return refuse(reason, size, "record v_V");
    if (!has(b, DRIVEID_SIGNAL_I_A)) return lumped(b, s, speed, reason, size);
    const driveid_param *gain = named(b, "K_t_Nm_A");
    if (!gain && !has(b, DRIVEID_SIGNAL_TAU_NM)) {
        const driveid_status status = driveid_model_set_frame(&b->online->model, DRIVEID_FRAME_AMPERE, reason, size);
        if (status) return status;
        note_missing(b, "J_kgm2, B_Nms_rad: only per ampere; give K_t_Nm_A or record tau_Nm");
    }
    const driveid_status status = circuit(b, reason, size);
    if (status) return status;
    const int torque = has(b, DRIVEID_SIGNAL_TAU_NM);
    const double per_drive = torque || !gain ? 1 : gain->value;
    mechanical(b, 1, s, speed, torque ? DRIVEID_SIGNAL_TAU_NM : DRIVEID_SIGNAL_I_A, per_drive);
    known(b, 1, drive_channel(b), 0, -per_drive);
    return DRIVEID_OK;
}

/* dq, amplitude-invariant. The mechanical equation shares psi_pm, L_d and L_q with the voltage equations, which give its scale. */
static driveid_status pmsm(build *b, char *reason, size_t size) {
    driveid_signal s;
    const int speed = motion(b, 0, &s);
    const driveid_param *pairs = named(b, "pole_pairs");
    if (!pairs) return refuse(reason, size, "give pole_pairs");
    if (!has(b, DRIVEID_SIGNAL_V_D_V) || !has(b, DRIVEID_SIGNAL_V_Q_V) || !has(b, DRIVEID_SIGNAL_I_D_A) || !has(b, DRIVEID_SIGNAL_I_Q_A))
        return refuse(reason, size, "record v_d_V, v_q_V, i_d_A and i_q_A");
    if (speed < 0) return refuse(reason, size, "record theta_rad or omega_rad_s");
    const double p = pairs->value;
    const driveid_param *r = named(b, "R_ohm"), *l_d = named(b, "L_d_H"), *l_q = named(b, "L_q_H"), *psi = named(b, "psi_pm_Vs");
    const int i_d = signal_channel(b, DRIVEID_SIGNAL_I_D_A), i_q = signal_channel(b, DRIVEID_SIGNAL_I_Q_A), turn = signal_channel(b, s);
    const int w_i_d = channel_of(b, ONLINE_SPEED_TIMES, DRIVEID_SIGNAL_I_D_A, 0), w_i_q = channel_of(b, ONLINE_SPEED_TIMES, DRIVEID_SIGNAL_I_Q_A, 0);
    need_speed(b, s, speed);
    term(b, 0, i_d, 0, r, 0, 1);
    term(b, 0, i_d, 1, l_d, 0, 1);
    term(b, 0, w_i_q, 0, l_q, 0, -p);
    known(b, 0, signal_channel(b, DRIVEID_SIGNAL_V_D_V), 0, -1);
    term(b, 1, i_q, 0, r, 0, 1);
    term(b, 1, i_q, 1, l_q, 0, 1);
    term(b, 1, w_i_d, 0, l_d, 0, p);
    term(b, 1, turn, speed, psi, 0, p);
    known(b, 1, signal_channel(b, DRIVEID_SIGNAL_V_Q_V), 0, -1);
    const int reluctance = channel_of(b, ONLINE_PRODUCT, DRIVEID_SIGNAL_I_D_A, DRIVEID_SIGNAL_I_Q_A);
    mechanical(b, 2, s, speed, DRIVEID_SIGNAL_I_Q_A, driveid_model_gain(&b->online->model));
    term(b, 2, drive_channel(b), 0, psi, 0, -1.5 * p);
    term(b, 2, reluctance, 0, l_d, 0, -1.5 * p);
    term(b, 2, reluctance, 0, l_q, 0, 1.5 * p);
    b->online->regression.bandwidth_rad_s = 200;
    b->online->regression.model_error = CIRCUIT_ERROR;
    return DRIVEID_OK;
}

static driveid_status lti(build *b, char *reason, size_t size) {
    const driveid_model *m = &b->online->model;
    int n = 0, order = 0;
    if (!has(b, DRIVEID_SIGNAL_U) || !has(b, DRIVEID_SIGNAL_Y)) return refuse(reason, size, "record u and y");
    const int y = signal_channel(b, DRIVEID_SIGNAL_Y), u = signal_channel(b, DRIVEID_SIGNAL_U);
    for (uint32_t i = 0; i < m->params; i++) {
        const int is_a = m->param[i].name[0] == 'a';
        term(b, 0, is_a ? y : u, is_a ? n++ : order++, &m->param[i], 1, is_a ? 1 : -1);
    }
    known(b, 0, y, n, 1);
    return DRIVEID_OK;
}

static driveid_status build_structure(build *b, char *reason, size_t size) {
    switch (b->online->model.structure) {
    case DRIVEID_STRUCTURE_RIGID_AXIS: return axis(b, 0, reason, size);
    case DRIVEID_STRUCTURE_LINEAR_AXIS: return axis(b, 1, reason, size);
    case DRIVEID_STRUCTURE_DC_CIRCUIT: return circuit(b, reason, size);
    case DRIVEID_STRUCTURE_DC_DRIVE: return dc_drive(b, reason, size);
    case DRIVEID_STRUCTURE_PMSM_DRIVE: return pmsm(b, reason, size);
    case DRIVEID_STRUCTURE_LTI: return lti(b, reason, size);
    default: return refuse(reason, size, "this structure is identified off-line (driveid fit); on line take rigid_axis");
    }
}

driveid_status driveid_online_init(driveid_online *online, const driveid_model *model, uint32_t signals,
                                   char *reason, size_t reason_size) {
    if (reason && reason_size) reason[0] = 0;
    if (!online || !model) return DRIVEID_ERR_ARGUMENT;
    memset(online, 0, sizeof *online);
    online->model = *model;
    online->mechanical = -1;
    build b = {online, signals, 0};
    const driveid_status status = build_structure(&b, reason, reason_size);
    if (status) return status;
    if (b.failed) return refuse(reason, reason_size, "the model has more terms than an on-line estimator holds");
    if (online->physical == 0) return refuse(reason, reason_size, "every parameter is given: nothing is left to estimate");
    return DRIVEID_OK;
}

/* Inductance from its apparent value R dt/2 coth(R dt/(2 L)). */
static double inductance(double apparent, double r, double dt_s) {
    const double c = 0.5 * r * dt_s / apparent;
    return c > 1e-6 && c < 0.999 ? 0.5 * r * dt_s / atanh(c) : apparent;
}

/* The current bends between its readings where the voltage is held; means over the same intervals need no correction, whatever happens inside. */
static int current_bends(const driveid_online *o) {
    int held = 0, instants = 0;
    for (unsigned c = 0; c < o->regression.channels; c++) {
        const driveid_online_channel *f = &o->filler[c];
        if (f->kind != ONLINE_SIGNAL) continue;
        const uint8_t hold = o->regression.hold[c];
        held |= hold == DRIVEID_HOLD_ZERO && (f->a == DRIVEID_SIGNAL_V_V || f->a == DRIVEID_SIGNAL_V_D_V || f->a == DRIVEID_SIGNAL_V_Q_V);
        instants |= hold == DRIVEID_HOLD_FIRST && (f->a == DRIVEID_SIGNAL_I_A || f->a == DRIVEID_SIGNAL_I_D_A || f->a == DRIVEID_SIGNAL_I_Q_A);
    }
    return held && instants;
}

static double resistance(const driveid_online *o, const driveid_estimate *e) {
    for (uint32_t i = 0; i < o->physical; i++)
        if (strcmp(o->physical_name[i], "R_ohm") == 0) return e->theta[i];
    const driveid_param *given = driveid_model_param(&o->model, "R_ohm");
    return given ? given->value : 0;
}

static void correct_inductance(const driveid_online *o, const driveid_estimate *e, uint32_t i, driveid_param *out) {
    const double r = resistance(o, e), value = inductance(e->theta[i], r, o->dt_s), step = 1e-4 * e->theta[i];
    const double slope = (inductance(e->theta[i] + step, r, o->dt_s) - value) / step; /* R is known far better than L */
    out->value = value;
    out->lo = value - slope * (e->theta[i] - e->lo[i]);
    out->hi = value + slope * (e->hi[i] - e->theta[i]);
}

driveid_status driveid_online_physical(const driveid_online *online, const driveid_estimate *estimate,
                                       driveid_param *out, uint32_t *valid_mask) {
    if (!online || !estimate || !out || !valid_mask || estimate->params != online->physical) return DRIVEID_ERR_ARGUMENT;
    for (uint32_t i = 0; i < online->physical; i++) {
        memcpy(out[i].name, online->physical_name[i], sizeof out[i].name);
        memcpy(out[i].unit, online->physical_unit[i], sizeof out[i].unit);
        out[i].state = DRIVEID_PARAM_FREE;
        out[i].value = estimate->theta[i];
        out[i].lo = estimate->lo[i];
        out[i].hi = estimate->hi[i];
        const char *name = online->physical_name[i];
        const int is_l = strcmp(name, "L_H") == 0 || strcmp(name, "L_d_H") == 0 || strcmp(name, "L_q_H") == 0;
        if (is_l && (estimate->valid_mask >> i & 1) && current_bends(online)) correct_inductance(online, estimate, i, &out[i]);
    }
    *valid_mask = estimate->valid_mask;
    return DRIVEID_OK;
}
