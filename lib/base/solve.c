/* SPDX-License-Identifier: Apache-2.0 */
#include "solve.h"

#include <math.h>

/* Largest remaining diagonal among the variables that are not yet ordered. */
static int next_pivot(const double *s, const int *order, int from, int n) {
    int best = from;
    for (int i = from + 1; i < n; i++)
        if (s[order[i] * n + order[i]] > s[order[best] * n + order[best]]) best = i;
    return best;
}

/* In place: s keeps the factor in its lower part in the pivoted order. */
static int factor(double *s, int *order, int n, double small) {
    for (int k = 0; k < n; k++) {
        const int best = next_pivot(s, order, k, n), p = order[best];
        order[best] = order[k];
        order[k] = p;
        if (!(s[p * n + p] > small)) return k;
        const double root = sqrt(s[p * n + p]);
        s[p * n + p] = root;
        for (int i = k + 1; i < n; i++) s[order[i] * n + p] /= root;
        for (int i = k + 1; i < n; i++)
            for (int j = k + 1; j <= i; j++) {
                const int a = order[i], b = order[j];
                s[a * n + b] -= s[a * n + p] * s[b * n + p];
                s[b * n + a] = s[a * n + b];
            }
    }
    return n;
}

int driveid_solve_inverse(const double *a, int n, double small, double *inverse, double *pivot) {
    double s[DRIVEID_SOLVE_MAX * DRIVEID_SOLVE_MAX], scale[DRIVEID_SOLVE_MAX], column[DRIVEID_SOLVE_MAX];
    int order[DRIVEID_SOLVE_MAX];
    if (n > DRIVEID_SOLVE_MAX) return 0;
    for (int i = 0; i < n; i++) {
        scale[i] = a[i * n + i] > 0 ? 1 / sqrt(a[i * n + i]) : 0;
        order[i] = i;
        pivot[i] = 0;
    }
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            s[i * n + j] = a[i * n + j] * scale[i] * scale[j];
            inverse[i * n + j] = 0;
        }
    const int rank = factor(s, order, n, small);
    for (int c = 0; c < rank; c++) {
        for (int i = 0; i < rank; i++) {
            double sum = i == c;
            for (int k = 0; k < i; k++) sum -= s[order[i] * n + order[k]] * column[k];
            column[i] = sum / s[order[i] * n + order[i]];
        }
        for (int i = rank; i-- > 0;) {
            double sum = column[i];
            for (int k = i + 1; k < rank; k++) sum -= s[order[k] * n + order[i]] * column[k];
            column[i] = sum / s[order[i] * n + order[i]];
        }
        pivot[order[c]] = 1 / column[c];
        for (int i = 0; i < rank; i++)
            inverse[order[i] * n + order[c]] = column[i] * scale[order[i]] * scale[order[c]];
    }
    return rank;
}

static void swap_rows(double *a, int columns, int i, int j) {
    for (int c = 0; c < columns; c++) {
        const double x = a[i * columns + c];
        a[i * columns + c] = a[j * columns + c];
        a[j * columns + c] = x;
    }
}

int driveid_solve_general(const double *a, int n, const double *scale, double *inverse) {
    double w[2 * DRIVEID_SOLVE_MAX * DRIVEID_SOLVE_MAX];
    const int wide = 2 * n;
    if (n > DRIVEID_SOLVE_MAX) return 0;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            w[i * wide + j] = scale[i] > 0 && scale[j] > 0 ? a[i * n + j] * scale[i] * scale[j] : i == j;
            w[i * wide + n + j] = i == j;
        }
    for (int k = 0; k < n; k++) {
        int best = k;
        for (int i = k + 1; i < n; i++)
            if (fabs(w[i * wide + k]) > fabs(w[best * wide + k])) best = i;
        if (!(fabs(w[best * wide + k]) > 1e-13)) return 0;
        swap_rows(w, wide, k, best);
        const double pivot = w[k * wide + k];
        for (int c = 0; c < wide; c++) w[k * wide + c] /= pivot;
        for (int i = 0; i < n; i++) {
            const double f = w[i * wide + k];
            for (int c = 0; c < wide && i != k; c++) w[i * wide + c] -= f * w[k * wide + c];
        }
    }
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) inverse[i * n + j] = scale[i] > 0 && scale[j] > 0 ? w[i * wide + n + j] * scale[i] * scale[j] : 0;
    return 1;
}
