// SPDX-License-Identifier: Apache-2.0
// Output error: parameters whose simulation follows the measured outputs, over windows with free initial states.
//
// Windows are simulated from unknown initial states that each window's own least squares removes (variable projection), so a window of any
// length, down to some tens of samples and up to the whole stretch, is one method: short windows forgive a disturbed or noisy input, long ones
// resolve weak parameters. Memories of effects (bristles, winding heat) are carried from window to window.
// A window must start where the record is: its first rows weigh as much as their sensor noise allows, not as little as the error of the
// whole window would give them, lest an initial state that contradicts them make up for the model.
// Whitened, the residual passes a monic filter found from the residual itself (noise.hpp): a noisy input or an unmodelled force makes the simulation
// drift, and the drift of a sample ago is then taken for granted; what stays is nearly white, so that long windows cost nothing and counts are honest.
// A skew between input and outputs (a part of a sample) may be a nuisance parameter, and with it the input's course between samples, to second order
// (a part of its second difference): read as straight lines, steps and decays of a current within a sample look like a few thousandths of inertia.
// Steps are Gauss-Newton with Levenberg-Marquardt damping; derivatives are differences of simulations. The covariance is a sandwich over blocks of
// the projected score, so it holds for coloured residuals; windows far outside the others' error are weighted down (Huber).
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include <driveid/simulate.h>

namespace driveid::batch {

struct Stretch {                 // one gap-free piece of a record; owns its columns
  std::vector<double> t_s;
  std::vector<double> column[DRIVEID_SIGNAL_COUNT];  // empty: absent
  driveid_hold hold = DRIVEID_HOLD_FIRST;
  double skew_s = 0;                                 // the input acts so much later than its hold says
  double noise[DRIVEID_SIGNAL_COUNT] = {};           // standard deviation of each sensor, 0 where unknown
  driveid_sim_record view() const;
};

struct FreeParam {               // where a free parameter lives in the model, and how far one may step
  int effect = -1;               // -1: the structure's
  int index = 0;
  double scale = 1;              // size of a difference step, about a tenth of its uncertainty
  double lo = -1e300, hi = 1e300;
  double prior = 0;              // deviation from zero that is known beforehand; 0: nothing is
};

struct OutputErrorProblem {
  driveid_model model;           // start values in it
  driveid_sim_mode mode = DRIVEID_SIM_MECHANICAL;
  std::vector<FreeParam> free;
  std::vector<driveid_signal> outputs;
  std::vector<const Stretch *> stretches;
  double window_s = 0;           // 0: whole stretches
  bool whiten = false;
  bool free_skew = false;        // nuisances: a skew of the input added to that of all stretches, and what it does between samples
  double most_skew = 0.6;        // samples
  double most_blur = 0.15;       // of the second difference: a held value read as a line is 1/24, an average read as an instant 1/12
  bool free_motion = false;      // a circuit: the motion's stamps may be off those of voltage and current by a part of a sample, as the input's may
  int iterations = 8;
  std::function<bool()> cancelled;
};

struct OutputErrorResult {
  driveid_model model;           // values replaced; intervals untouched
  Eigen::MatrixXd covariance;    // of the free parameters
  Eigen::VectorXd rmse;          // by output, windows as fitted
  double skew_s = 0;             // found, beyond that of the stretches
  double cost = 0;
  double quantile = 1.96;        // deviations in half of a 95 % interval
  double agreement = 1;          // least likeness of steps up and down, 0..1: well below 1 the differences are no derivatives
  bool ok = false;
};

double &value_of(driveid_model &model, const FreeParam &free);
OutputErrorResult fit_output_error(const OutputErrorProblem &problem);

inline constexpr std::size_t kHead = 20;   // rows that pin the initial state of a free run

// Free run over one stretch. The initial state is estimated from the first `settle` rows by the model itself. out[s] sized rows where wanted.
bool free_run(const driveid_model &model, const Stretch &stretch, driveid_sim_mode mode, std::size_t from, std::size_t to, std::size_t settle,
              std::vector<double> (&out)[DRIVEID_SIGNAL_COUNT], const std::vector<driveid_signal> &wanted);

}  // namespace driveid::batch
