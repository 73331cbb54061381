// SPDX-License-Identifier: Apache-2.0
// What the files of the modal method share: quadrature weights, solves that return rank, companion matrices.
#pragma once

#include <Eigen/Core>
#include <driveid/modal.h>

#include <optional>
#include <vector>

namespace driveid::modal {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

inline constexpr std::size_t order_max = 12;

// Weights of the composite rule over `intervals` steps of length T_s; empty where the rule does not fit the number of intervals.
VectorXd quadrature_weights(std::size_t intervals, double T_s, driveid_quadrature rule);

// Least squares with columns scaled to unit length; nothing where the columns are dependent.
std::optional<MatrixXd> solve(const MatrixXd &A, const MatrixXd &B);

// Phase-variable matrix of s^n + a_{n-1} s^{n-1} + ... + a_0.
MatrixXd companion(std::size_t order, const double *a);

// e^{A t}
MatrixXd exponential(const MatrixXd &A, double t_s);

// The costly decompositions stand once, in modal_internal.cpp: each is a minute of template work for the compiler.
MatrixXd logarithm(const MatrixXd &A);
Eigen::VectorXcd eigenvalues(const MatrixXd &A);
VectorXd singular_values(const MatrixXd &A);
VectorXd last_right_singular_vector(const MatrixXd &A);
MatrixXd orthonormal_columns(const MatrixXd &A); // Q of A = Q R
MatrixXd triangle(const MatrixXd &A);            // R of A = Q R
MatrixXd inverse(const MatrixXd &A);

// Coefficients a_0 .. a_{n-1} of the characteristic polynomial by the trace recursion [EQ MOD-4.50, first index a_{n-k+1}].
VectorXd characteristic(const MatrixXd &A);

// Do all shifted indices of every window lie inside the record?
bool fits(const driveid_modal_task &task, std::int64_t extra = 0);

} // namespace driveid::modal
