/* SPDX-License-Identifier: Apache-2.0 */
/* Own effects: a recursive grammar parsed without recursion (operator precedence, one fixed stack) into postfix code.
 *
 * Precedence, lowest first: + -, * /, unary minus, ^ (right to left). */
#include <driveid/effect.h>

#include <ctype.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TEXT_MAX 400

enum {
    OP_NUMBER, OP_VARIABLE, OP_PARAM, OP_DIRECTION,
    OP_ADD, OP_SUB, OP_MUL, OP_DIV, OP_POW, OP_NEG,
    OP_SIN, OP_COS, OP_TAN, OP_TANH, OP_EXP, OP_LOG, OP_SQRT, OP_ABS, OP_SIGN, OP_MIN, OP_MAX, OP_POW2,
    OP_OPEN /* only on the stack of the parser */
};

static const struct { const char *name; uint8_t code, arguments; } functions[] = {
    {"sin", OP_SIN, 1}, {"cos", OP_COS, 1}, {"tan", OP_TAN, 1}, {"tanh", OP_TANH, 1}, {"exp", OP_EXP, 1}, {"log", OP_LOG, 1},
    {"sqrt", OP_SQRT, 1}, {"abs", OP_ABS, 1}, {"sign", OP_SIGN, 1}, {"min", OP_MIN, 2}, {"max", OP_MAX, 2}, {"pow", OP_POW2, 2},
};
#define FUNCTIONS (sizeof functions / sizeof functions[0])

static const char *const variables[] = {
    "t_s", "theta_rad", "x_m", "omega_rad_s", "v_m_s", "alpha_rad_s2", "a_m_s2", "i_A", "i_q_A", "tau_Nm", "F_N", "v_V", "T_degC",
};
#define VARIABLES (sizeof variables / sizeof variables[0])
enum { VARIABLE_OMEGA = 3, VARIABLE_V = 4 };

static double variable_value(const driveid_effect_state *s, uint8_t index) {
    switch (index) {
    case 0: return s->t_s;
    case 1: case 2: return s->angle;
    case 3: case 4: return s->speed;
    case 5: case 6: return s->accel;
    case 7: case 8: return s->current_A;
    case 9: case 10: return s->torque;
    case 11: return s->voltage_V;
    default: return s->T_degC;
    }
}

/* ---- parser ---- */

typedef struct { uint8_t code, arguments, commas; uint32_t column; } pending;

typedef struct {
    const char *text;
    uint32_t at;
    driveid_formula *out;
    pending stack[DRIVEID_FORMULA_DEPTH_MAX];
    uint32_t depth;
    uint32_t values; /* on the stack of the evaluation, after the code so far */
    char *message;
    size_t message_size;
} parser;

static driveid_status complain(parser *p, uint32_t column, const char *format, ...) {
    char what[160];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(what, sizeof what, format, arguments);
    va_end(arguments);
    if (p->message && p->message_size) snprintf(p->message, p->message_size, "formula, column %u: %s", (unsigned)(column + 1), what);
    return DRIVEID_ERR_FORMAT;
}

static uint32_t arity(uint8_t code) {
    switch (code) {
    case OP_NUMBER: case OP_VARIABLE: case OP_PARAM: case OP_DIRECTION: return 0;
    case OP_ADD: case OP_SUB: case OP_MUL: case OP_DIV: case OP_POW: case OP_MIN: case OP_MAX: case OP_POW2: return 2;
    default: return 1;
    }
}

static driveid_status emit(parser *p, uint8_t code, uint8_t index, double value, uint32_t column) {
    driveid_formula *f = p->out;
    if (f->length >= DRIVEID_FORMULA_CODE_MAX) return complain(p, column, "too long: at most %d operations; split the effect in two", DRIVEID_FORMULA_CODE_MAX);
    if (code == OP_SIGN && f->length && f->op[f->length - 1].code == OP_VARIABLE &&
        (f->op[f->length - 1].index == VARIABLE_OMEGA || f->op[f->length - 1].index == VARIABLE_V)) {
        f->op[f->length - 1].code = OP_DIRECTION; /* sign(speed): has a side at rest */
        f->uses_direction = 1;
        return DRIVEID_OK;
    }
    p->values = p->values - arity(code) + 1;
    if (p->values > DRIVEID_FORMULA_DEPTH_MAX) return complain(p, column, "nested too deeply: at most %d levels", DRIVEID_FORMULA_DEPTH_MAX);
    f->op[f->length++] = (driveid_formula_op){code, index, value};
    return DRIVEID_OK;
}

static int precedence(uint8_t code) {
    switch (code) {
    case OP_ADD: case OP_SUB: return 1;
    case OP_MUL: case OP_DIV: return 2;
    case OP_NEG: return 3;
    case OP_POW: return 4;
    default: return 0; /* brackets stop */
    }
}

static driveid_status push(parser *p, uint8_t code, uint8_t arguments, uint32_t column) {
    if (p->depth >= DRIVEID_FORMULA_DEPTH_MAX) return complain(p, column, "nested too deeply: at most %d levels", DRIVEID_FORMULA_DEPTH_MAX);
    p->stack[p->depth++] = (pending){code, arguments, 0, column};
    return DRIVEID_OK;
}

static driveid_status pop_to(parser *p, int level) {
    while (p->depth && precedence(p->stack[p->depth - 1].code) >= level && precedence(p->stack[p->depth - 1].code) > 0) {
        const pending top = p->stack[--p->depth];
        const driveid_status s = emit(p, top.code, 0, 0.0, top.column);
        if (s) return s;
    }
    return DRIVEID_OK;
}

static driveid_status read_number(parser *p) {
    const uint32_t column = p->at;
    char digits[48];
    uint32_t n = 0;
    while (n + 1 < sizeof digits) { /* copied, so that strtod cannot read hexadecimal, "nan" or past the operand */
        const char c = p->text[p->at];
        const int exponent_sign = (c == '+' || c == '-') && n && (digits[n - 1] == 'e' || digits[n - 1] == 'E');
        if (!isdigit((unsigned char)c) && c != '.' && !((c == 'e' || c == 'E') && n) && !exponent_sign) break;
        digits[n++] = c;
        p->at++;
    }
    digits[n] = 0;
    char *end;
    const double value = strtod(digits, &end);
    if (*end || !isfinite(value)) return complain(p, column, "\"%s\" is not a number; write 1.5 or 2e-3", digits);
    return emit(p, OP_NUMBER, 0, value, column);
}

static driveid_status read_param(parser *p, const char *name, uint32_t column) {
    driveid_formula *f = p->out;
    uint32_t k = 0;
    while (k < f->params && strcmp(f->param[k], name) != 0) k++;
    if (k == f->params) {
        if (k >= DRIVEID_FORMULA_PARAMS_MAX) return complain(p, column, "more than %d parameters", DRIVEID_FORMULA_PARAMS_MAX);
        snprintf(f->param[f->params++], DRIVEID_FORMULA_NAME_SIZE, "%s", name);
    }
    return emit(p, OP_PARAM, (uint8_t)k, 0.0, column);
}

static void skip_blanks(parser *p) {
    while (p->text[p->at] == ' ' || p->text[p->at] == '\t') p->at++;
}

static driveid_status read_function(parser *p, const char *name, uint32_t column) {
    for (uint32_t k = 0; k < FUNCTIONS; k++)
        if (strcmp(name, functions[k].name) == 0) {
            p->at++; /* the bracket */
            return push(p, functions[k].code, functions[k].arguments, column);
        }
    return complain(p, column, "no function \"%.40s\"; there are sin cos tan tanh exp log sqrt abs sign min max pow", name);
}

/* *operand: 1 where a value is complete afterwards, 0 where one must follow (a function opened its bracket). */
static driveid_status read_name(parser *p, int *operand) {
    const uint32_t column = p->at;
    char name[DRIVEID_FORMULA_NAME_SIZE];
    uint32_t n = 0;
    while (isalnum((unsigned char)p->text[p->at]) || p->text[p->at] == '_') {
        if (n + 1 >= sizeof name) return complain(p, column, "name longer than %d characters", DRIVEID_FORMULA_NAME_SIZE - 1);
        name[n++] = p->text[p->at++];
    }
    name[n] = 0;
    skip_blanks(p);
    if (p->text[p->at] == '(') {
        *operand = 0;
        return read_function(p, name, column);
    }
    *operand = 1;
    if (strcmp(name, "pi") == 0) return emit(p, OP_NUMBER, 0, 3.14159265358979323846, column);
    for (uint32_t k = 0; k < FUNCTIONS; k++)
        if (strcmp(name, functions[k].name) == 0) return complain(p, column, "\"%s\" is a function: give its argument in brackets", name);
    for (uint32_t k = 0; k < VARIABLES; k++)
        if (strcmp(name, variables[k]) == 0) {
            p->out->variables |= 1u << k;
            return emit(p, OP_VARIABLE, (uint8_t)k, 0.0, column);
        }
    return read_param(p, name, column);
}

static driveid_status read_operand(parser *p, int *operand) {
    const char c = p->text[p->at];
    const uint32_t column = p->at;
    *operand = 0;
    if (isdigit((unsigned char)c) || c == '.') {
        *operand = 1;
        return read_number(p);
    }
    if (isalpha((unsigned char)c) || c == '_') return read_name(p, operand);
    if (c == '(') return p->at++, push(p, OP_OPEN, 1, column);
    if (c == '-') return p->at++, push(p, OP_NEG, 0, column);
    if (c == '+') return p->at++, DRIVEID_OK;
    if (!c) return complain(p, column, "ends where a value is expected");
    return complain(p, column, isprint((unsigned char)c) ? "a value is expected here, not \"%c\"" : "a value is expected here, not byte %d", c);
}

static driveid_status close_bracket(parser *p, int comma) {
    const uint32_t column = p->at++;
    driveid_status s = pop_to(p, 1);
    if (s) return s;
    if (!p->depth) return complain(p, column, comma ? "comma outside a function" : "bracket closed that was never opened");
    pending *top = &p->stack[p->depth - 1];
    if (comma) {
        if (++top->commas >= top->arguments) return complain(p, column, "too many arguments");
        return DRIVEID_OK;
    }
    if (top->commas + 1 != top->arguments) return complain(p, column, "too few arguments: %d are needed", top->arguments);
    p->depth--;
    return top->code == OP_OPEN ? DRIVEID_OK : emit(p, top->code, 0, 0.0, top->column);
}

static driveid_status read_operator(parser *p, int *operand) {
    const char c = p->text[p->at];
    const uint32_t column = p->at;
    static const char symbols[] = "+-*/^";
    static const uint8_t codes[] = {OP_ADD, OP_SUB, OP_MUL, OP_DIV, OP_POW};
    if (c == ')') return close_bracket(p, 0);
    if (c == ',') return *operand = 0, close_bracket(p, 1);
    const char *found = c ? strchr(symbols, c) : NULL;
    if (!found) return complain(p, column, isprint((unsigned char)c) ? "an operator is expected here, not \"%c\"" : "an operator is expected here, not byte %d", c);
    const uint8_t code = codes[found - symbols];
    p->at++;
    *operand = 0;
    const driveid_status s = pop_to(p, code == OP_POW ? 5 : precedence(code)); /* ^ groups to the right */
    return s ? s : push(p, code, 0, column);
}

static driveid_status parse(parser *p) {
    int operand = 0;
    for (;;) {
        skip_blanks(p);
        if (operand && !p->text[p->at]) break;
        const driveid_status s = operand ? read_operator(p, &operand) : read_operand(p, &operand);
        if (s) return s;
    }
    const driveid_status s = pop_to(p, 1);
    if (s) return s;
    return p->depth ? complain(p, p->stack[p->depth - 1].column, "bracket never closed") : DRIVEID_OK;
}

/* ---- which parameters are jointly linear ---- */

typedef struct { uint32_t depends, bent; } reach;

static reach combine(uint8_t code, reach a, reach b) {
    reach r = {a.depends | b.depends, a.bent | b.bent};
    if (code == OP_MUL && a.depends && b.depends) r.bent |= b.depends;
    if (code == OP_DIV) r.bent |= b.depends;
    if (code == OP_POW || code == OP_POW2 || code == OP_MIN || code == OP_MAX) r.bent |= r.depends;
    return r;
}

static uint32_t linear_params(const driveid_formula *f) {
    reach stack[DRIVEID_FORMULA_DEPTH_MAX + 2];
    uint32_t n = 0;
    for (uint32_t k = 0; k < f->length; k++) {
        const driveid_formula_op *op = &f->op[k];
        const uint32_t take = arity(op->code);
        reach r = {0, 0};
        if (op->code == OP_PARAM) r.depends = 1u << op->index;
        if (take == 1) r = stack[n - 1], r.bent |= op->code == OP_NEG ? 0 : r.depends;
        if (take == 2) r = combine(op->code, stack[n - 2], stack[n - 1]);
        n -= take;
        stack[n++] = r;
    }
    return ((1u << f->params) - 1u) & ~stack[0].bent;
}

driveid_status driveid_formula_parse(const char *text, driveid_formula *formula, char *message, size_t message_size) {
    if (message && message_size) message[0] = 0;
    if (!text || !formula) return DRIVEID_ERR_ARGUMENT;
    driveid_formula out;
    memset(&out, 0, sizeof out);
    parser p = {.text = text, .out = &out, .message = message, .message_size = message_size};
    if (strlen(text) > TEXT_MAX) return complain(&p, TEXT_MAX, "longer than %d characters", TEXT_MAX);
    const driveid_status s = parse(&p);
    if (s) return s;
    out.linear_mask = linear_params(&out);
    *formula = out;
    return DRIVEID_OK;
}

/* ---- evaluation ---- */

static double apply1(uint8_t code, double x) {
    switch (code) {
    case OP_NEG: return -x;
    case OP_SIN: return sin(x);
    case OP_COS: return cos(x);
    case OP_TAN: return tan(x);
    case OP_TANH: return tanh(x);
    case OP_EXP: return exp(x);
    case OP_LOG: return log(x);
    case OP_SQRT: return sqrt(x);
    case OP_ABS: return fabs(x);
    default: return (x > 0.0) - (x < 0.0);
    }
}

static double apply2(uint8_t code, double a, double b) {
    switch (code) {
    case OP_ADD: return a + b;
    case OP_SUB: return a - b;
    case OP_MUL: return a * b;
    case OP_DIV: return a / b;
    case OP_MIN: return fmin(a, b);
    case OP_MAX: return fmax(a, b);
    default: return pow(a, b);
    }
}

double driveid_formula_value(const driveid_formula *formula, const driveid_effect_state *state, const double *param, uint32_t *bad) {
    double stack[DRIVEID_FORMULA_DEPTH_MAX + 2];
    uint32_t n = 0;
    for (uint32_t k = 0; k < formula->length; k++) {
        const driveid_formula_op *op = &formula->op[k];
        switch (op->code) {
        case OP_NUMBER: stack[n++] = op->value; break;
        case OP_VARIABLE: stack[n++] = variable_value(state, op->index); break;
        case OP_PARAM: stack[n++] = param[op->index]; break;
        case OP_DIRECTION: stack[n++] = state->direction; break;
        default:
            if (arity(op->code) == 1) {
                stack[n - 1] = apply1(op->code, stack[n - 1]);
            } else {
                n--;
                stack[n - 1] = apply2(op->code, stack[n - 1], stack[n]);
            }
        }
    }
    if (n == 1 && isfinite(stack[0])) return stack[0];
    if (bad) ++*bad;
    return 0.0;
}

double driveid_formula_columns(const driveid_formula *formula, const driveid_effect_state *state, const double *param, double *column) {
    double probe[DRIVEID_FORMULA_PARAMS_MAX] = {0};
    for (uint32_t k = 0; k < formula->params; k++) probe[k] = formula->linear_mask >> k & 1u ? 0.0 : param[k];
    const double rest = driveid_formula_value(formula, state, probe, NULL);
    for (uint32_t k = 0; k < formula->params; k++) {
        column[k] = 0.0;
        if (!(formula->linear_mask >> k & 1u)) continue;
        probe[k] = 1.0;
        column[k] = driveid_formula_value(formula, state, probe, NULL) - rest;
        probe[k] = 0.0;
    }
    return rest;
}
