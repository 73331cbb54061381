// SPDX-License-Identifier: Apache-2.0
// Errors of a model in simulation.
#pragma once

#include <vector>

#include "batch/output_error.hpp"

namespace driveid::diagnose {

// RMS error of a signal: window_s = 0 free run from the start of the stretch (initial state from its first 20 rows, scored from row 21 on);
// else windows of that length one after another, each from the state that its own first rows suggest. Negative: it could not run.
double score_windows(const driveid_model &model, const batch::Stretch &stretch, driveid_sim_mode mode, driveid_signal signal, double window_s);

// The predictions themselves, rows of the stretch long (NaN where nothing is predicted). Empty: it could not run.
std::vector<double> predict_windows(const driveid_model &model, const batch::Stretch &stretch, driveid_sim_mode mode, driveid_signal signal, double window_s);

// One sample ahead, from a state that follows the measurement (a fixed-gain observer on the measured output).
std::vector<double> predict_one_step(const driveid_model &model, const batch::Stretch &stretch, driveid_sim_mode mode, driveid_signal signal);

// RMS of measured - predicted from row `skip` on, over the rows that are predicted. Negative: none.
double rms_error(const std::vector<double> &measured, const std::vector<double> &predicted, std::size_t skip);

inline constexpr std::size_t kSettle = 20;   // rows behind the initial state of a free run

}  // namespace driveid::diagnose
