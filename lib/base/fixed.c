/* SPDX-License-Identifier: Apache-2.0 */
#include "fixed.h"

int32_t fixed_q31(double x) {
    const double scaled = x * 2147483648.0 + (x < 0 ? -0.5 : 0.5);
    return scaled >= 2147483647.0 ? INT32_MAX : scaled <= -2147483648.0 ? INT32_MIN : (int32_t)scaled;
}
