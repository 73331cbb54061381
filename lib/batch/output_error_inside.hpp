// SPDX-License-Identifier: Apache-2.0
// Inside of output error: what is moved, the windows, one linearisation, what is known of its parameters.
#pragma once

#include "batch/noise.hpp"
#include "batch/output_error.hpp"

namespace driveid::batch {

constexpr double kNeverPinned = 1e9;
constexpr int kSkew = -2, kBlur = -3, kMotion = -4;   // FreeParam::effect of the nuisances

struct Point {                                  // what is moved
  driveid_model model;
  double skew_s = 0;
  double blur = 0;                              // share of its second difference that the input gains between samples
  double motion = 0;                            // samples by which the speed column comes late
};

struct Window {
  std::size_t stretch, from, to, at;            // at: first row in the stacked outputs
  double x[DRIVEID_X_COUNT];
  double memory[DRIVEID_MODEL_EFFECTS_MAX][DRIVEID_EFFECT_MEMORY];
};

struct Fitting {
  const OutputErrorProblem &problem;
  std::vector<FreeParam> free;                  // the problem's, and the skew
  std::vector<double> step;                     // difference step of each free parameter
  std::vector<Window> windows;
  std::size_t rows = 0;
  std::vector<double> measured, scale;          // stacked: window, output, row; 1/noise by output
  std::vector<double> head;                     // by output: factor on the first rows of a whole stretch
  std::vector<NoiseFilter> filter;              // by output
  std::vector<uint32_t> states;                 // indices of free initial states
  double state_step[DRIVEID_X_COUNT] = {};
};

using Stack = std::vector<double>;

struct Local {                       // one window, initial states projected out
  Eigen::MatrixXd Jp, Js;            // scaled, projected Jp; raw Js factors kept for the state step
  Eigen::VectorXd r;                 // projected
  Eigen::MatrixXd state_gain;        // maps raw scaled residual to the state step
  Eigen::VectorXd raw;
  Eigen::MatrixXd rawJp;
  double weight = 1;
};

struct Linear {
  std::vector<Stack> columns;        // differences by parameter, then by state
  std::vector<Local> local;
  Eigen::MatrixXd A;
  Eigen::VectorXd b;
  Eigen::VectorXd prior;             // what is known beforehand, in units of A
};

// One pass over all windows with a model. moved: index into states of the initial state that is shifted by its step, or -1.
bool simulate(const Fitting &f, const Point &point, int moved, std::vector<Window> *remember, Stack &out);
double &value_at(Point &point, const FreeParam &free);
void make_windows(Fitting &f);
void stack_measured(Fitting &f);

// All simulations of one linearisation; parameter columns are shared out between two threads. Backwards: parameters are moved to the
// other side, and the columns of the states stay as they are.
bool columns(const Fitting &f, const Point &point, const Stack &base, std::vector<Stack> &out, bool backwards = false);
void prepare_rows(const Fitting &f, std::size_t o, double *x, std::size_t n);   // scaled and filtered, in place
Local localise(const Fitting &f, std::size_t w, const Stack &base, const std::vector<Stack> &d);
bool linearise(Fitting &f, const Point &point, const Stack &base, Linear &lin, bool weights, bool filters = false);
double total_cost(const Fitting &f, const Stack &base, const std::vector<double> &weight);
double prior_cost(const Fitting &f, const Linear &lin, const Point &point);
void weigh_outputs(Fitting &f, const Stack &base);

Eigen::MatrixXd pseudo_inverse(const Eigen::MatrixXd &A);
Eigen::VectorXd agreement(const Fitting &fitted, const Point &point, const Stack &base, const Linear &lin);
void covariance(const Fitting &f, const Linear &lin, const Eigen::VectorXd &alike, OutputErrorResult &result);

}  // namespace driveid::batch
