/* SPDX-License-Identifier: Apache-2.0 */
/* A model as data: parameters of the structure and of its effects, their names in the model's frame. */
#include "model/structure.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

static int complain(char *reason, size_t size, const char *format, const char *a, const char *b) {
    if (reason && size) snprintf(reason, size, format, a, b);
    return 0;
}

static void param_name(const driveid_structure_param *p, driveid_frame frame, int linear, char *name, char *unit, size_t unit_size) {
    const char *symbol = linear && p->symbol_linear ? p->symbol_linear : p->symbol;
    const char *suffix = p->suffix ? p->suffix : driveid_dimension_suffix(p->dimension, frame, 'A');
    snprintf(name, DRIVEID_NAME_SIZE, "%s%s%s", symbol, suffix[0] ? "_" : "", suffix);
    snprintf(unit, unit_size, "%s", p->unit ? p->unit : driveid_dimension_unit(p->dimension, frame, 'A'));
}

static void put(driveid_param *param, const char *name, const char *unit) {
    memset(param, 0, sizeof *param);
    snprintf(param->name, sizeof param->name, "%s", name);
    snprintf(param->unit, sizeof param->unit, "%s", unit);
}

static driveid_frame natural_frame(driveid_structure structure) {
    return driveid_structure_get(structure)->linear ? DRIVEID_FRAME_FORCE : DRIVEID_FRAME_TORQUE;
}

static void lti_params(driveid_model *model, uint32_t n, uint32_t m) {
    char name[DRIVEID_NAME_SIZE];
    model->params = 0;
    for (uint32_t k = 0; k < n; k++) snprintf(name, sizeof name, "a_%u", (unsigned)k), put(&model->param[model->params++], name, "");
    for (uint32_t k = 0; k <= m; k++) snprintf(name, sizeof name, "b_%u", (unsigned)k), put(&model->param[model->params++], name, "");
}

driveid_status driveid_model_init(driveid_model *model, driveid_structure structure) {
    const driveid_structure_info *info = driveid_structure_get(structure);
    if (!model || !info) return DRIVEID_ERR_ARGUMENT;
    memset(model, 0, sizeof *model);
    model->structure = structure;
    if (structure == DRIVEID_STRUCTURE_LTI) {
        lti_params(model, 2, 0);
        return DRIVEID_OK;
    }
    for (uint32_t k = 0; k < info->params; k++) {
        char name[DRIVEID_NAME_SIZE], unit[16];
        if (info->param[k].only_given) continue;
        param_name(&info->param[k], natural_frame(structure), info->linear, name, unit, sizeof unit);
        put(&model->param[model->params++], name, unit);
    }
    return DRIVEID_OK;
}

static driveid_param *find(driveid_model *model, const char *name) {
    for (uint32_t k = 0; k < model->params; k++)
        if (strcmp(model->param[k].name, name) == 0) return &model->param[k];
    return NULL;
}

const driveid_param *driveid_model_param(const driveid_model *model, const char *name) {
    if (!model || !name) return NULL;
    for (uint32_t k = 0; k < model->params; k++)
        if (strcmp(model->param[k].name, name) == 0) return &model->param[k];
    return NULL;
}

static driveid_status give_lti_order(driveid_model *model, const char *name, double value) {
    uint32_t n = 0, m = 0;
    for (uint32_t k = 0; k < model->params; k++) *(model->param[k].name[0] == 'a' ? &n : &m) += 1;
    m -= 1;
    if (value != floor(value) || value < 0.0 || value > 6.0) return DRIVEID_ERR_ARGUMENT;
    *(name[0] == 'n' ? &n : &m) = (uint32_t)value;
    if (n < 1 || m > n) return DRIVEID_ERR_ARGUMENT;
    lti_params(model, n, m);
    return DRIVEID_OK;
}

/* The name may belong to another frame ("J_As2_rad" before anything else fixed the frame): move there first. */
static driveid_param *find_in_frames(driveid_model *model, const char *name) {
    driveid_param *param = find(model, name);
    const driveid_frame before = driveid_model_frame(model);
    for (int frame = 0; !param && frame < DRIVEID_FRAME_COUNT; frame++) {
        if (driveid_model_set_frame(model, (driveid_frame)frame, NULL, 0)) continue;
        param = find(model, name);
        if (!param) (void)driveid_model_set_frame(model, before, NULL, 0);
    }
    return param;
}

static void name_effect_params(const driveid_model *model, driveid_effect_use *use, driveid_frame frame);

static driveid_param *find_only_given(driveid_model *model, const char *name) {
    const driveid_structure_info *info = driveid_structure_get(model->structure);
    for (uint32_t k = 0; k < info->params; k++) {
        char full[DRIVEID_NAME_SIZE], unit[16];
        if (!info->param[k].only_given) continue;
        param_name(&info->param[k], natural_frame(model->structure), info->linear, full, unit, sizeof unit);
        if (strcmp(full, name) != 0 || model->params >= DRIVEID_PARAMS_MAX) continue;
        driveid_param *param = &model->param[model->params++];
        put(param, full, unit);
        for (uint32_t e = 0; e < model->effects; e++) name_effect_params(model, &model->effect[e], driveid_model_frame(model));
        return param;
    }
    return NULL;
}

driveid_status driveid_model_give(driveid_model *model, const char *name, double value) {
    if (!model || !name || !isfinite(value) || !driveid_structure_get(model->structure)) return DRIVEID_ERR_ARGUMENT;
    if (model->structure == DRIVEID_STRUCTURE_LTI && (strcmp(name, "n") == 0 || strcmp(name, "m") == 0)) return give_lti_order(model, name, value);
    driveid_param *param = find_in_frames(model, name);
    if (!param) param = find_only_given(model, name);
    if (!param) return DRIVEID_ERR_ARGUMENT;
    if (strcmp(name, "pole_pairs") == 0 && (value < 1.0 || value != floor(value))) return DRIVEID_ERR_ARGUMENT;
    param->state = DRIVEID_PARAM_GIVEN;
    param->value = param->lo = param->hi = value;
    return DRIVEID_OK;
}

/* ---- frames ---- */

driveid_frame driveid_model_frame(const driveid_model *model) {
    const driveid_structure_info *info = driveid_structure_get(model->structure);
    for (uint32_t k = 0; k < info->params; k++) {
        if (info->param[k].suffix || info->param[k].dimension != DRIVEID_DIM_INERTIA) continue;
        for (int frame = 0; frame < DRIVEID_FRAME_COUNT; frame++) {
            char name[DRIVEID_NAME_SIZE], unit[16];
            param_name(&info->param[k], (driveid_frame)frame, info->linear, name, unit, sizeof unit);
            if (driveid_model_param(model, name)) return (driveid_frame)frame;
        }
    }
    return natural_frame(model->structure);
}

static int frame_fits(const driveid_structure_info *info, driveid_structure structure, driveid_frame frame) {
    if (info->linear) return frame == DRIVEID_FRAME_FORCE || frame == DRIVEID_FRAME_AMPERE_LINEAR;
    if (frame == DRIVEID_FRAME_VOLT) return structure == DRIVEID_STRUCTURE_DC_DRIVE;
    return frame == DRIVEID_FRAME_TORQUE || (frame == DRIVEID_FRAME_AMPERE && structure != DRIVEID_STRUCTURE_PMSM_DRIVE);
}

static int is_mechanical_unit(driveid_dimension d) { return d >= DRIVEID_DIM_FORCE && d <= DRIVEID_DIM_INERTIA; }

static const char *blocking_given(const driveid_model *model) {
    const driveid_structure_info *info = driveid_structure_get(model->structure);
    const driveid_frame frame = driveid_model_frame(model);
    for (uint32_t k = 0; k < info->params; k++) {
        char name[DRIVEID_NAME_SIZE], unit[16];
        if (info->param[k].suffix || !is_mechanical_unit(info->param[k].dimension)) continue;
        param_name(&info->param[k], frame, info->linear, name, unit, sizeof unit);
        const driveid_param *p = driveid_model_param(model, name);
        if (p && p->state == DRIVEID_PARAM_GIVEN) return p->name;
    }
    for (uint32_t e = 0; e < model->effects; e++) {
        const driveid_effect_info *effect = driveid_effect_find(model->effect[e].name);
        for (uint32_t k = 0; effect && k < model->effect[e].params && k < effect->params; k++)
            if (model->effect[e].param[k].state == DRIVEID_PARAM_GIVEN && is_mechanical_unit(effect->param[k].dimension)) return model->effect[e].param[k].name;
    }
    return NULL;
}

static void name_effect_params(const driveid_model *model, driveid_effect_use *use, driveid_frame frame) {
    const driveid_effect_info *effect = driveid_effect_find(use->name);
    const char drive = frame == DRIVEID_FRAME_VOLT ? 'V' : driveid_model_drive_unit(model);
    for (uint32_t k = 0; effect && k < effect->params && k < use->params; k++) {
        driveid_effect_param_name(effect, k, frame, drive, use->param[k].name, sizeof use->param[k].name);
        driveid_effect_param_unit(effect, k, frame, drive, use->param[k].unit, sizeof use->param[k].unit);
    }
}

driveid_status driveid_model_set_frame(driveid_model *model, driveid_frame frame, char *reason, size_t reason_size) {
    const driveid_structure_info *info = model ? driveid_structure_get(model->structure) : NULL;
    if (!info || !frame_fits(info, model->structure, frame)) return DRIVEID_ERR_ARGUMENT;
    const driveid_frame before = driveid_model_frame(model);
    if (frame == before || !info->mechanical) return DRIVEID_OK;
    const char *blocked = blocking_given(model);
    if (blocked) {
        complain(reason, reason_size, "%s is given, but this record measures %s: give the torque constant too, or take the given value out", blocked,
                 driveid_dimension_unit(DRIVEID_DIM_FORCE, frame, 'A'));
        return DRIVEID_ERR_CONFIG;
    }
    for (uint32_t k = 0; k < info->params; k++) {
        char old[DRIVEID_NAME_SIZE], name[DRIVEID_NAME_SIZE], unit[16];
        if (info->param[k].suffix) continue;
        param_name(&info->param[k], before, info->linear, old, unit, sizeof unit);
        param_name(&info->param[k], frame, info->linear, name, unit, sizeof unit);
        driveid_param *p = find(model, old);
        if (!p) continue;
        memcpy(p->name, name, sizeof name);
        memcpy(p->unit, unit, sizeof unit);
    }
    for (uint32_t e = 0; e < model->effects; e++) name_effect_params(model, &model->effect[e], frame);
    return DRIVEID_OK;
}

static double given(const driveid_model *model, const char *name, double otherwise) {
    const driveid_param *p = driveid_model_param(model, name);
    return p && p->state != DRIVEID_PARAM_UNSET ? p->value : otherwise;
}

double driveid_model_gain(const driveid_model *model) {
    switch (model->structure) {
    case DRIVEID_STRUCTURE_LINEAR_AXIS: return driveid_model_frame(model) == DRIVEID_FRAME_FORCE ? given(model, "K_F_N_A", 1.0) : 1.0;
    case DRIVEID_STRUCTURE_PMSM_DRIVE: return 1.5 * given(model, "pole_pairs", 1.0) * given(model, "psi_pm_Vs", 1.0);
    case DRIVEID_STRUCTURE_DC_DRIVE: /* K_t = K_e in SI where nothing else is said */
        return driveid_model_frame(model) == DRIVEID_FRAME_TORQUE ? given(model, "K_t_Nm_A", given(model, "K_e_Vs_rad", 1.0)) : 1.0;
    case DRIVEID_STRUCTURE_RIGID_AXIS: case DRIVEID_STRUCTURE_TWO_MASS_AXIS:
        return driveid_model_frame(model) == DRIVEID_FRAME_TORQUE ? given(model, "K_t_Nm_A", 1.0) : 1.0;
    default: return 1.0;
    }
}

char driveid_model_drive_unit(const driveid_model *model) {
    const driveid_frame frame = driveid_model_frame(model);
    switch (model->structure) {
    case DRIVEID_STRUCTURE_DC_CIRCUIT: case DRIVEID_STRUCTURE_DC_DRIVE: return 'V';
    case DRIVEID_STRUCTURE_PMSM_DRIVE: return 'A';
    case DRIVEID_STRUCTURE_LINEAR_AXIS: return frame == DRIVEID_FRAME_AMPERE_LINEAR || driveid_model_param(model, "K_F_N_A") ? 'A' : 'N';
    default: return frame == DRIVEID_FRAME_AMPERE || driveid_model_param(model, "K_t_Nm_A") ? 'A' : 'N';
    }
}

/* ---- effects ---- */

static int applies(const driveid_model *model, const driveid_effect_info *effect, char *reason, size_t reason_size) {
    const driveid_structure_info *info = driveid_structure_get(model->structure);
    const int mechanical = info->mechanical && (effect->domains & DRIVEID_EFFECT_MECHANICAL);
    const int electrical = info->electrical && (effect->domains & DRIVEID_EFFECT_ELECTRICAL);
    if (!mechanical && !electrical) return complain(reason, reason_size, "effect \"%s\" has no place in structure \"%s\"", effect->name, info->name);
    if ((effect->needs & DRIVEID_NEED_ROTARY) && info->linear) return complain(reason, reason_size, "effect \"%s\" needs a turn: structure \"%s\" is linear", effect->name, info->name);
    if (model->structure == DRIVEID_STRUCTURE_TWO_MASS_AXIS && strcmp(effect->name, "compliance") == 0)
        return complain(reason, reason_size, "\"%s\" is already part of structure \"%s\"", effect->name, info->name);
    for (uint32_t e = 0; e < model->effects; e++)
        if (!effect->repeats && strcmp(model->effect[e].name, effect->name) == 0)
            return complain(reason, reason_size, "the model has \"%s\" already%s", effect->name, "");
    return 1;
}

/* "tau_Nm = c * omega_rad_s": the left side says what the effect adds to. The rest of the formula; the side in left. */
static const char *left_side(const char *formula, char *left, size_t size) {
    const char *equals = strchr(formula, '='), *from = formula, *to = equals;
    if (!equals) return formula;
    while (from < to && isspace((unsigned char)*from)) from++;
    while (to > from && isspace((unsigned char)to[-1])) to--;
    snprintf(left, size, "%.*s", (int)(to - from), from);
    for (equals++; isspace((unsigned char)*equals);) equals++;
    return to > from ? equals : formula;   /* nothing before the "=": the parser refuses it */
}

static driveid_status add_own(driveid_effect_use *use, const char *formula, const char *adds_to, char *reason, size_t reason_size) {
    driveid_formula parsed;
    char left[sizeof use->adds_to] = "";
    formula = left_side(formula, left, sizeof left);
    if (left[0] && adds_to && strcmp(left, adds_to)) {
        complain(reason, reason_size, "formula of \"%s\" adds to one signal and adds_to names another%s", use->name, "");
        return DRIVEID_ERR_ARGUMENT;
    }
    if (left[0]) adds_to = left;
    const driveid_status s = driveid_formula_parse(formula, &parsed, reason, reason_size);
    if (s) return s;
    if (strlen(formula) >= sizeof use->formula) {
        complain(reason, reason_size, "formula of \"%s\" is longer than 159 characters%s", use->name, "");
        return DRIVEID_ERR_CAPACITY;
    }
    if (!adds_to || (strcmp(adds_to, "tau_Nm") && strcmp(adds_to, "F_N") && strcmp(adds_to, "v_V") && strcmp(adds_to, "i_A"))) {
        complain(reason, reason_size, "adds_to of \"%s\" must be tau_Nm, F_N, i_A (mechanical equation) or v_V (electrical): write formula = \"tau_Nm = ...\"%s", use->name, "");
        return DRIVEID_ERR_ARGUMENT;
    }
    snprintf(use->formula, sizeof use->formula, "%s", formula);
    snprintf(use->adds_to, sizeof use->adds_to, "%s", adds_to);
    use->params = parsed.params;
    for (uint32_t k = 0; k < parsed.params; k++) put(&use->param[k], parsed.param[k], "");
    return DRIVEID_OK;
}

driveid_status driveid_model_add(driveid_model *model, const char *effect, const char *formula, const char *adds_to, char *reason, size_t reason_size) {
    if (reason && reason_size) reason[0] = 0;
    if (!model || !effect || !driveid_structure_get(model->structure)) return DRIVEID_ERR_ARGUMENT;
    if (model->effects >= DRIVEID_MODEL_EFFECTS_MAX) {
        complain(reason, reason_size, "no room for \"%s\": a model holds at most 12 effects%s", effect, "");
        return DRIVEID_ERR_CAPACITY;
    }
    const driveid_effect_info *info = driveid_effect_find(effect);
    driveid_effect_use use;
    memset(&use, 0, sizeof use);
    if (strlen(effect) >= sizeof use.name || !effect[0]) {
        complain(reason, reason_size, "effect name \"%.60s\" must have 1 to 39 characters%s", effect, "");
        return DRIVEID_ERR_ARGUMENT;
    }
    snprintf(use.name, sizeof use.name, "%s", effect);
    if (formula && formula[0]) {
        if (info) {
            complain(reason, reason_size, "\"%s\" is an effect of the catalogue: give the own effect another name%s", effect, "");
            return DRIVEID_ERR_ARGUMENT;
        }
        const driveid_status s = add_own(&use, formula, adds_to, reason, reason_size);
        if (s) return s;
    } else {
        if (!info) {
            complain(reason, reason_size, "no effect \"%s\": `driveid catalogue` lists them; an own one needs a formula%s", effect, "");
            return DRIVEID_ERR_ARGUMENT;
        }
        if (!applies(model, info, reason, reason_size)) return DRIVEID_ERR_ARGUMENT;
        use.params = info->params;
        name_effect_params(model, &use, driveid_model_frame(model));
    }
    model->effect[model->effects++] = use;
    return DRIVEID_OK;
}
