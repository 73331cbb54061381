/* SPDX-License-Identifier: Apache-2.0 */
#include "kernel.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

int kernel_shapes(const driveid_svf_common *common, kernel_shape *shape, uint8_t *of_term) {
    const driveid_regression *r = &common->regression;
    int count = 0;
    for (int i = 0; i < r->terms; i++) {
        const kernel_shape s = {r->term[i].derivative, r->hold[r->term[i].channel], common->equation[r->term[i].equation].order};
        int k = 0;
        while (k < count && memcmp(&shape[k], &s, sizeof s) != 0) k++;
        if (k == KERNEL_SHAPES) return 0;
        if (k == count) shape[count++] = s;
        of_term[i] = (uint8_t)k;
    }
    return count;
}

int kernel_lengths(const driveid_svf_common *common, unsigned shapes, uint16_t *length, char *reason, size_t reason_size) {
    const double dt = common->options.dt_s;
    const unsigned channels = common->regression.channels, order = common->sections - 2u;
    double n = fmax(10 / (common->options.bandwidth_rad_s * dt), 6.0 * (order + 1));
    unsigned used = 0;
    int stages = 0;
    for (; stages < LEARN_STAGES; stages++, n *= KERNEL_STAGE_RATIO) {
        const unsigned even = 4 * (unsigned)ceil(n / 4);
        if (even >= KERNEL_SAMPLES || (even + 1) * channels > KERNEL_RING || used + (even + 1) * shapes > KERNEL_POOL) break;
        length[stages] = (uint16_t)even;
        used += (even + 1) * shapes;
    }
    if (!stages && reason && reason_size)
        snprintf(reason, reason_size, "a window of %.0f samples does not fit the fixed memory: take a higher bandwidth_rad_s or sample more slowly", n);
    return stages;
}

static const double binomial[DRIVEID_ORDER_MAX + 1][DRIVEID_ORDER_MAX + 1] = {{1}, {1, 1}, {1, 2, 1}, {1, 3, 3, 1}, {1, 4, 6, 4, 1},
                                                                             {1, 5, 10, 10, 5, 1}, {1, 6, 15, 20, 15, 6, 1}};

static double power(double x, int k) {
    double y = 1;
    while (k-- > 0) y *= x;
    return y;
}

static double falling(int a, int k) {
    double y = 1;
    while (k-- > 0) y *= a--;
    return y;
}

/* k-th derivative of u^a (1-u)^a, by Leibniz; no terms that cancel. */
static double bell(int a, int k, double u) {
    double sum = 0;
    for (int i = 0; i <= k; i++)
        sum += ((k - i) & 1 ? -1 : 1) * binomial[k][i] * falling(a, i) * power(u, a - i) * falling(a, k - i) * power(1 - u, a - k + i);
    return sum;
}

static double bell_area(int a) { /* a!^2 / (2a+1)! */
    double area = 1;
    for (int i = 1; i <= a; i++) area *= (double)i / (a + i);
    return area / (2 * a + 1);
}

/* Integral of the k-th derivative over [from, to], Gauss-Legendre. */
static double bell_part(int a, int k, double from, double to) {
    static const double node[3] = {-0.7745966692414834, 0, 0.7745966692414834}, share[3] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
    double sum = 0;
    for (int g = 0; g < 3; g++) sum += share[g] * bell(a, k, (from + to + node[g] * (to - from)) / 2);
    return sum * (to - from);
}

/* Closed Newton-Cotes weights of panels of four even steps (Boole), else Simpson's rule for uneven pairs of steps. */
static void quadrature(const double *u, int n, double *q) {
    static const double boole[5] = {14.0 / 45, 64.0 / 45, 24.0 / 45, 64.0 / 45, 14.0 / 45};
    int even = n % 4 == 0;
    for (int i = 0; i <= n; i++) {
        q[i] = 0;
        even &= fabs(u[i] * n - i) < 1e-9 * n;
    }
    for (int i = 0; even && i < n; i += 4)
        for (int j = 0; j < 5; j++) q[i + j] += boole[j] / n;
    for (int i = 0; !even && i < n; i += 2) {
        const double h = u[i + 1] - u[i], g = u[i + 2] - u[i + 1], third = (h + g) / 6;
        q[i] += third * (2 - g / h);
        q[i + 1] += third * (h + g) * (h + g) / (h * g);
        q[i + 2] += third * (2 - h / g);
    }
}

void kernel_window_weights(const kernel_shape *s, const double *u, int n, double T_s, double *out) {
    const int a = s->order + 1, k = s->derivative;
    const double scale = (k & 1 ? -1 : 1) / (bell_area(a) * power(T_s, k));
    if (s->hold == DRIVEID_HOLD_FIRST) {
        quadrature(u, n, out);
        for (int i = 0; i <= n; i++) out[i] *= scale * bell(a, k, u[i]);
        return;
    }
    const int shift = s->hold == DRIVEID_HOLD_AVERAGE; /* the value of the step's end, not of its start */
    out[shift ? 0 : n] = 0;
    for (int i = 0; i < n; i++) out[i + shift] = scale * bell_part(a, k, u[i], u[i + 1]);
}

/* Weight of the iterated sums: the polynomial that kills what was before the block, times C(n-j, a) [EQ DIS-3, 9]. */
static double sum_weight(int j, int n, int a) {
    double w = 1;
    for (int i = 0; i < a; i++) w *= (double)(j - i) * (n - j - i) / ((double)n * n / 4);
    return j < a || n - j < a ? 0 : w;
}

/* W^k (z-1)^k (z+1)^(order-k) moved onto the weights; a held input has (1 - q/W) = 2/(z+1) [EQ DIS-5, 6]. */
void kernel_discrete_weights(const kernel_shape *s, const double *u, int n, double T_s, double *out) {
    const int k = s->derivative, held = s->hold != DRIVEID_HOLD_FIRST && k < s->order, late = s->hold == DRIVEID_HOLD_AVERAGE;
    const int plus = s->order - k - held, span = n - s->order, a = s->order + 1;
    double operate[DRIVEID_ORDER_MAX + 2] = {held ? 2 : 1}, area = 0;
    (void)u;
    for (int degree = 0, d = 0; d < k + plus; d++, degree++) /* times (z -+ 1) */
        for (int i = degree + 1; i >= 0; i--) operate[i] = (i > 0 ? operate[i - 1] : 0) + (d < k ? -operate[i] : operate[i]);
    for (int j = 0; j <= span; j++) area += sum_weight(j, span, a);
    const double scale = power(2 * n / T_s, k) / (area * power(2, s->order));
    for (int i = 0; i <= n; i++) {
        out[i] = 0;
        for (int j = 0; j <= k + plus; j++)
            if (i - j - late >= 0 && i - j - late <= span) out[i] += scale * operate[j] * sum_weight(i - j - late, span, a);
    }
}
