// SPDX-License-Identifier: Apache-2.0
// Fit: values and intervals for the free parameters of a model, from prepared records.
//
//   1. start: whitened least squares of each equation (the diagnosis's own engine), shapes of effects searched;
//   2. refine: output error (lib/batch) with whitened residuals over windows of two lengths, and plain over free runs of whole records;
//   3. choose: whitened, which has honest intervals, unless a free run (or the equation) predicts kept-aside stretches clearly better with values that
//      the whitened intervals exclude: then the model is imperfect, and the intervals reach over both.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "batch/output_error.hpp"
#include "diagnose/equation.hpp"

namespace driveid::diagnose {

struct FitOptions {
  int threads = 2;
  bool refine = true;                              // false: equation least squares alone (fast)
  double window_s = -1;                            // >= 0: this objective and no other; 0: free run
  bool whiten = false;                             // that objective, residuals made white
  std::function<bool(double, const char *)> tick;  // done, what; false cancels
};

struct FitOutcome {
  driveid_model model;
  std::string objective;       // "equation", "windows of 4 s, whitened", ..., "free run"
  std::vector<Notice> notices;
  std::string bad;             // not empty: cannot be fitted, and what to record
  bool cancelled = false;
};

// Moves the model to the frame that the record and the given parameters allow. False: why, in reason.
bool adopt_frame(driveid_model &model, const Prepared &record, std::string &reason);

// How the driving channel of a mode is read: the hold that was told, or the nearest to what the equations found, and the rest as a skew.
struct Timing {
  driveid_hold hold = DRIVEID_HOLD_FIRST;
  double skew_s = 0;
  bool told = false;
};
Timing timing_of(const std::vector<const Equation *> &equations, const Prepared &record, driveid_sim_mode mode);
Timing timing_of(const EquationSet &set, const Prepared &record, driveid_sim_mode mode);

// One gap-free stretch per piece, columns under their canonical names, speed derived from the angle where only that is recorded.
std::vector<batch::Stretch> make_stretches(const driveid_model &model, const Prepared &record, const Timing &timing);

// Parts of a structure that are fitted one after another (circuit, then axis), with the signals that judge them.
struct Part {
  driveid_sim_mode mode;
  std::vector<driveid_signal> outputs;
  driveid_sim_mode judged_mode = mode;                    // a circuit beside an axis is judged by what the whole drive then does:
  std::vector<driveid_signal> judged_outputs = outputs;   // its current forgives a wrong back-EMF, the speed does not
};
std::vector<Part> parts_of(const driveid_model &model, const Prepared &record);

// How the whole model runs on this record: from the voltage where it is recorded with the current, else the axis alone.
driveid_sim_mode whole_mode(const driveid_model &model, const Prepared &record);

// Signals whose free run is scored for the whole model: the axis' position (or speed), else the current, else y.
driveid_signal scored_signal(const driveid_model &model, const Prepared &record);

// Values and intervals from one equation, into the model. Needs the whitening of the equation.
bool fit_equation(const Equation &equation, driveid_model &model, int threads, std::vector<Notice> &notices);

// Two estimators of one truth: the interval is the wider of theirs (a simulation that hangs on a threshold looks far too sure of itself); where they
// contradict each other the model is imperfect, and it reaches over both.
void reconcile(driveid_param &refined, const driveid_param &found);
bool is_phase(const char *name);

// Values and intervals of a model that has values already (an explanation's), by whitened output error; what cannot be refined stays as it is.
void refine_values(driveid_model &model, uint32_t first_effect, const std::vector<Prepared> &training, const std::vector<const Equation *> &equations);

FitOutcome fit_model(const driveid_model &model, const std::vector<Prepared> &training, const std::vector<Prepared> &held_out, const FitOptions &options);

}  // namespace driveid::diagnose
