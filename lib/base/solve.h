/* SPDX-License-Identifier: Apache-2.0 */
/* Small dense symmetric solve that returns its rank. Always in f64: it runs at the rate of answers, not of samples. */
#ifndef DRIVEID_BASE_SOLVE_H
#define DRIVEID_BASE_SOLVE_H

/* Largest n: the scratch of a solve is that large. The build of a small target may make it smaller. */
#ifndef DRIVEID_SOLVE_MAX
#define DRIVEID_SOLVE_MAX 16
#endif

/* Pseudo-inverse on the numerical range of a positive semi-definite matrix, by diagonally pivoted Cholesky of the matrix
 * scaled to unit diagonal.
 *   a       n x n row-major, symmetric; read only
 *   small   pivots below it count as zero (of 1): 1e-12 for f64 data, 1e-6 for sums kept in f32
 *   inverse n x n; rows and columns of dropped variables are zero
 *   pivot   n: what is left of each variable's unit diagonal when all others are taken out, 0 where dropped
 * Returns the rank; 0 above DRIVEID_SOLVE_MAX. Cost: n^3 multiply-adds. Accuracy: tests/unit/solve_test.cpp. */
int driveid_solve_inverse(const double *a, int n, double small, double *inverse, double *pivot);

/* Inverse of a general matrix by Gauss-Jordan elimination with row pivoting, after scaling rows and columns by scale[n] (zero: the variable
 * is left out, its row and column of the inverse are zero). Returns 1, or 0 where it is singular or above DRIVEID_SOLVE_MAX. */
int driveid_solve_general(const double *a, int n, const double *scale, double *inverse);

#endif
