// SPDX-License-Identifier: Apache-2.0
// Exact realisation of 1/F(s) and its derivatives on a sampled signal, for a hold.
#pragma once

#include "batch/modal_internal.hpp"

#include <driveid/lti.h>

namespace driveid::lti {

using modal::MatrixXd;
using modal::VectorXd;

// rows x n: column i is the i-th derivative of signal / F(s), F = s^n + f_{n-1} s^{n-1} + .. + f_0, from rest.
MatrixXd filtered(const VectorXd &signal, const VectorXd &f, double T_s, bool zero_order_hold);

// rows x n: column i is the i-th derivative of x / F(s), x = (B u + C) / A the continuous response to the held u and to the initial
// conditions C (none where empty): nothing is assumed between the samples of x.
MatrixXd cascaded(const VectorXd &u, const VectorXd &a, const VectorXd &b, const VectorXd &c, const VectorXd &f, double T_s, bool zero_order_hold);

// rows x n: column i is the response s^i / F(s) to an impulse at the first sample.
MatrixXd impulses(const VectorXd &f, double T_s, Eigen::Index rows);

// n-th derivative from the filter's own equation: signal - sum f_i D^i.
VectorXd highest(const VectorXd &signal, const MatrixXd &derivatives, const VectorXd &f);

// u moved later by `samples`; what came before the record is `before`.
VectorXd delayed(const VectorXd &u, std::size_t samples, double before);

} // namespace driveid::lti
