/* SPDX-License-Identifier: Apache-2.0 */
/* Fixed point: Q31 coefficients, per-unit values in Q30 (one guard bit), products in int64. Round half up; saturate and count, never wrap.
 * A right shift of a negative number is arithmetic on every compiler that this library is built with (asserted). */
#ifndef DRIVEID_BASE_FIXED_H
#define DRIVEID_BASE_FIXED_H

#include <stdint.h>

#ifndef __cplusplus
_Static_assert((-3 >> 1) == -2, "right shifts must be arithmetic");
#endif

#define FIXED_UNIT (INT32_C(1) << 30) /* 1 per unit */

static inline int64_t fixed_round(int64_t x, unsigned shift) { return shift ? (x + (INT64_C(1) << (shift - 1))) >> shift : x; }

static inline int32_t fixed_saturate(int64_t x, uint32_t *count) {
    if (x >= INT32_MIN && x <= INT32_MAX) return (int32_t)x;
    if (*count < UINT32_MAX) ++*count;
    return x < 0 ? INT32_MIN : INT32_MAX;
}

/* From configuration: |x| <= 1 to Q31, 1 becomes the largest number. */
int32_t fixed_q31(double x);

#endif
