// SPDX-License-Identifier: Apache-2.0
// What is looked for, mended and noticed in one column of a record, before its time is.
#pragma once

#include <cstdint>

#include "diagnose/record.hpp"

namespace driveid::diagnose {

double median_of(std::vector<double> v);
bool is_position(const std::string &name);
std::string text(const char *format, double a, double b = 0, double c = 0);
double predict_middle(const double *t, const double *x);   // value at x[2] predicted from its four neighbours (Lagrange), whose spacing may be uneven

void fill_missing(std::vector<double> &x);
void unwrap(std::vector<double> &x, const std::string &name, std::vector<Notice> &notices);
void mend_glitches(std::vector<double> &x, const std::string &name, std::vector<Notice> &notices);
SignalQuality quality_of(const std::vector<double> &x);

// Several samples of one stamp: it has too few digits. The rows between two gaps are then taken as evenly spaced; empty: not so.
std::vector<std::int64_t> spread_stamps(const driveid_record &record, std::vector<Notice> &notices);

// Limits, steps and units that a column shows by itself.
void notice_clipping(const std::vector<double> &x, const std::string &name, SignalQuality &q, std::vector<Notice> &notices);
void notice_steps(const std::string &name, const SignalQuality &q, std::vector<Notice> &notices);

// Rows that a clipped column falsifies become gaps.
void take_out_clipped(Prepared &record, const driveid_model &model);

void notice_unused(Prepared &record, const driveid_model &model);

// A speed column against the derivative of the angle: sign, unit and lag.
void check_speed(Prepared &record, const std::string &position, const std::string &speed);

}  // namespace driveid::diagnose
