/* SPDX-License-Identifier: Apache-2.0 */
#include "discrete_common.h"

#include <math.h>
#include <stddef.h>

#define SMALL 1e-14
#define ROUNDING 30 /* of a sum's terms: weights are products of up to 2 order factors */
#define ANSWER_REACH 1e-3 /* relative, of a coefficient: a pole of a wide spread moves by several times that */

int driveid_discrete_columns(const driveid_discrete_config *config) { return config->order + config->kept + 1; }

int driveid_discrete_rows(const driveid_discrete_config *config) { return driveid_discrete_columns(config) + config->extra; }

const char *driveid_discrete_refusal(const driveid_discrete_config *c, int is_f32) {
    if (c->order < 1 || c->order > DRIVEID_DISCRETE_ORDER_MAX) return "order must be 1 .. 8";
    if (c->zeros >= c->order) return "zeros must be below order";
    if (c->kept > c->zeros) return "kept must not exceed zeros";
    if (c->skipped < 1 || c->skipped > 20 || c->extra > 20) return "skipped must be 1 .. 20 and extra 0 .. 20";
    if (driveid_discrete_rows(c) > DRIVEID_DISCRETE_ROWS_MAX) return "too many rows: lower extra";
    if (c->block < 4u * c->order + c->skipped || c->block > 100000u) return "block must be 4 order + skipped .. 100000 samples";
    if (!(c->T_s > 0)) return "T_s must be positive";
    if (!(c->gamma > 0 && c->gamma <= 1)) return "gamma must be above 0 and at most 1";
    if (c->domain == DRIVEID_DISCRETE_Q && c->gamma != 1) return "the q domain needs gamma = 1: its differences act on polynomial weights";
    if (c->domain == DRIVEID_DISCRETE_Q && c->skipped < c->order + 1) return "the q domain needs skipped >= order + 1: the weights must vanish at the end of the block";
    if (is_f32 && c->domain == DRIVEID_DISCRETE_Z && c->order > 2) return "z domain above order 2 is beyond f32: take domain q, or f64";
    return NULL;
}

/* Each row to unit maximum, each column to unit length; noise[columns]: how long rounding alone would make it. */
static driveid_status scale(double row[][DRIVEID_DISCRETE_COLUMNS_MAX + 1], double square[][DRIVEID_DISCRETE_COLUMNS_MAX], int rows, int columns, double epsilon, double *length, double *noise) {
    for (int c = 0; c < columns; c++) length[c] = noise[c] = 0;
    for (int r = 0; r < rows; r++) {
        double largest = 0;
        for (int c = 0; c < columns; c++) largest = fmax(largest, fabs(row[r][c]));
        if (!(largest > 0) || !isfinite(largest)) return DRIVEID_RANK;
        for (int c = 0; c <= columns; c++) row[r][c] /= largest;
        for (int c = 0; c < columns; c++) length[c] += row[r][c] * row[r][c], noise[c] += square[r][c] / (largest * largest);
    }
    for (int c = 0; c < columns; c++) {
        length[c] = sqrt(length[c]);
        if (!(length[c] > 0)) return DRIVEID_RANK;
        noise[c] = epsilon * sqrt(noise[c]) / length[c];
        for (int r = 0; r < rows; r++) row[r][c] /= length[c];
    }
    return DRIVEID_OK;
}

/* Largest share of a denominator's coefficient that rounding of the columns may move: row i of R^-1 times the noise of what x makes of them.
 * A coefficient that is zero by nature (no damping) is measured by the geometric mean of its neighbours, of which the fixed one is 1. */
static double rounding_reach(const driveid_discrete_config *config, double row[][DRIVEID_DISCRETE_COLUMNS_MAX + 1], const double *diagonal, const double *x, const double *length, const double *noise, int columns) {
    const int n = config->order, q = config->domain == DRIVEID_DISCRETE_Q;
    double moved = 0, worst = 0;
    for (int c = 0; c < columns; c++) moved += noise[c] * x[c] * noise[c] * x[c];
    for (int i = 0; i < n; i++) {
        double inverse[DRIVEID_DISCRETE_COLUMNS_MAX], length_2 = 0;
        for (int c = i; c < columns; c++) {
            double value = c == i;
            for (int k = i; k < c; k++) value -= inverse[k] * row[k][c];
            inverse[c] = value / diagonal[c];
            length_2 += inverse[c] * inverse[c];
        }
        const double below = i > 0 ? x[i - 1] / length[i - 1] : q, above = i + 1 < n ? x[i + 1] / length[i + 1] : !q;
        worst = fmax(worst, sqrt(length_2 * moved) / fmax(fabs(x[i]), length[i] * sqrt(fabs(below * above))));
    }
    return worst;
}

driveid_status driveid_discrete_solve(const driveid_discrete_config *config, double row[][DRIVEID_DISCRETE_COLUMNS_MAX + 1], double square[][DRIVEID_DISCRETE_COLUMNS_MAX], double epsilon, double *theta, double *residual) {
    const int rows = driveid_discrete_rows(config), columns = driveid_discrete_columns(config);
    double diagonal[DRIVEID_DISCRETE_COLUMNS_MAX], length[DRIVEID_DISCRETE_COLUMNS_MAX], noise[DRIVEID_DISCRETE_COLUMNS_MAX], x[DRIVEID_DISCRETE_COLUMNS_MAX], least = SMALL;
    const driveid_status scaled = scale(row, square, rows, columns, epsilon, length, noise);
    if (scaled != DRIVEID_OK) return scaled;
    for (int c = 0; c < columns; c++) { /* Householder */
        double norm = 0;
        for (int r = c; r < rows; r++) norm += row[r][c] * row[r][c];
        norm = sqrt(norm);
        least = fmax(least, ROUNDING * noise[c]); /* what is taken out of a column brings its own rounding along */
        if (norm < least) return DRIVEID_RANK;
        const double alpha = row[c][c] > 0 ? -norm : norm;
        row[c][c] -= alpha;
        double reflector_2 = 0;
        for (int r = c; r < rows; r++) reflector_2 += row[r][c] * row[r][c];
        for (int k = c + 1; k <= columns; k++) {
            double dot = 0;
            for (int r = c; r < rows; r++) dot += row[r][c] * row[r][k];
            for (int r = c; r < rows; r++) row[r][k] -= 2 * dot / reflector_2 * row[r][c];
        }
        diagonal[c] = alpha; /* of R; the reflector's column is not needed again */
    }
    double rest = 0;
    for (int r = columns; r < rows; r++) rest += row[r][columns] * row[r][columns];
    for (int c = columns; c-- > 0;) {
        double value = row[c][columns];
        for (int k = c + 1; k < columns; k++) value -= row[c][k] * x[k];
        x[c] = value / diagonal[c];
    }
    if (!(rounding_reach(config, row, diagonal, x, length, noise, columns) < ANSWER_REACH)) return DRIVEID_RANK;
    for (int c = 0; c < columns; c++) theta[c] = x[c] / length[c];
    *residual = sqrt(rest / rows);
    return DRIVEID_OK;
}

double driveid_discrete_quantile(unsigned freedom) {
    static const double table[] = {12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228};
    if (freedom == 0) return INFINITY;
    if (freedom <= 10) return table[freedom - 1];
    const double z = 1.959964, n = (double)freedom; /* Cornish-Fisher, below 1e-3 from 11 on */
    return z + (z * z * z + z) / (4 * n) + (5 * pow(z, 5) + 16 * z * z * z + 3 * z) / (96 * n * n);
}
