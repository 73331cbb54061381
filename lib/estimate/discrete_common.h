/* SPDX-License-Identifier: Apache-2.0 */
/* What the two number types of the discrete estimator share. */
#ifndef DRIVEID_ESTIMATE_DISCRETE_COMMON_H
#define DRIVEID_ESTIMATE_DISCRETE_COMMON_H

#include <driveid/discrete.h>

int driveid_discrete_columns(const driveid_discrete_config *config);
int driveid_discrete_rows(const driveid_discrete_config *config);

/* Reason of a refusal, or NULL. */
const char *driveid_discrete_refusal(const driveid_discrete_config *config, int is_f32);

/* Rows scaled to unit maximum, columns to unit length, Householder QR. square: of what was summed into row, in numbers of that epsilon.
 * DRIVEID_RANK leaves theta alone: columns depend on each other, or rounding may move a denominator's coefficient by ANSWER_REACH. row is overwritten. */
driveid_status driveid_discrete_solve(const driveid_discrete_config *config, double row[][DRIVEID_DISCRETE_COLUMNS_MAX + 1], double square[][DRIVEID_DISCRETE_COLUMNS_MAX],
                                      double epsilon, double *theta, double *residual);

/* 97.5 % quantile of Student's t. */
double driveid_discrete_quantile(unsigned freedom);

#endif
