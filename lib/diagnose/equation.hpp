// SPDX-License-Identifier: Apache-2.0
// Equation engine: the drive's torque, force or voltage balance through compactly supported smooth kernels.
//
//   sum_k p_k (K_k * x_k)(t_r)  =  (K * input)(t_r)        at rows t_r spaced a third of the kernel's half width
//
// Derivatives are taken of the kernel, never of the data. Every regressor, nominal or candidate, passes the same
// kernel, so an instantaneous term stays exact. Rows overlap; their noise is whitened by an autoregression fitted to
// the residual of a flexible model (floor.hpp), after which least squares is nearly efficient and counts are honest.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include <driveid/effect.h>

#include "diagnose/record.hpp"

namespace driveid::diagnose {

struct Kernel {
  int half = 0;                    // taps at -half .. half
  std::vector<double> w[3];        // smoothing, d/dt, d2/dt2
};
Kernel make_kernel(int half, double dt_s);   // (1 - u^2)^4, moments corrected so that polynomials up to order 2 pass exactly

struct Track {                     // one piece of one record in one equation
  int record = 0;                  // index over training records, then held-out records
  bool held_out = false;
  int part = 0;                    // pmsm: 0 = d, 1 = q
  double t0_s = 0, dt_s = 0;
  Kernel kernel;
  std::vector<driveid_effect_state> state;   // fine grid
  std::vector<double> position;    // fine grid, as measured (or integrated speed)
  std::vector<double> position_smooth;   // by the same kernel: what the load behind a gap is driven by (a gap of some quanta would else smooth them)
  std::vector<double> speed_raw;   // only where speed is what is measured
  std::vector<double> drive_raw;   // driving channel as logged, before the input shift
  std::vector<double> current_raw; // voltage equations: the current as logged (states carry it smoothed)
  std::vector<double> still;       // share of each sample inside a short rest of a motion (equation_stick.cpp)
  std::vector<unsigned char> rest; // 1: the axis does not measurably move
  std::vector<int> row;            // centres of the rows on the fine grid
  std::vector<int> run;            // run number of each row: rows of one run are evenly spaced, without a hole
  std::size_t first = 0;           // index of its first row in the stacked vectors
};

struct BaseColumn {
  std::string name;                // parameter name in the model ("J_kgm2"); empty: a nuisance
  bool given = false;
  double value = 0;
};

struct Equation {
  std::string signal, unit;        // "torque", "N m"
  bool electrical = false;
  driveid_frame frame = DRIVEID_FRAME_TORQUE;
  char drive_unit = 'A';
  double gain = 1;
  double quantum = 0;              // step of the position's quantisation, or six times its noise where that is more; 0 where speed is measured
  double input_noise = 0;          // of the drive as logged, sample to sample
  double input_shift_s = 0;        // time to add to the stamps of the input: +dt/2 held, -dt/2 averaged over the sample before
  std::vector<Track> tracks;
  std::size_t rows = 0;
  Eigen::VectorXd y;               // target, raw rows: the drive less the given terms
  Eigen::VectorXd drive;           // gain * drive, raw rows
  Eigen::VectorXd current, current_smooth;   // voltage equations: rows of the current as logged, and of the one in the states
  Eigen::MatrixXd base;            // free nominal columns, raw rows
  std::vector<BaseColumn> base_column;
  double floor_lo = 0;             // propagated sensor noise and quantisation, at these rows (RMS)
  double noise_motion = 0, noise_drive = 0;   // variances of white noise on the position (or speed) and on the drive (floor.hpp)
  // whitening: e_k - sum ar_j e_{k-j} inside each run
  std::vector<double> ar;
  std::vector<int> block;          // block of each row: where evidence is counted
  std::vector<int> block_fold;     // fold of each block: what is left out together in cross-validation
  std::vector<unsigned char> block_held_out;
  std::vector<unsigned char> mask; // 1: a lone outlier far beyond everything else, left out (empty: none)
  std::vector<double> weight;      // of whitened rows: 0 at the head of a run
};

// Smoothed rows of a fine-grid signal x (derivative 0..2) of one track, written to out[row.size()].
void apply_kernel(const Track &track, const std::vector<double> &x, int derivative, double *out);

// Stacked rows of a signal given per track.
using FineSignal = std::function<void(const Track &, std::vector<double> &)>;
Eigen::VectorXd stack(const Equation &equation, const FineSignal &signal, int derivative);

// Takes the drive itself out of a column that is made from it: otherwise a sum of such columns could cancel the target.
double remove_drive(const Equation &equation, Eigen::Ref<Eigen::VectorXd> column);

void same_current(const Equation &equation, Eigen::Ref<Eigen::MatrixXd> columns);

// Columns of an effect at given shapes: rows x info->columns, raw.
Eigen::MatrixXd effect_columns(const Equation &equation, const driveid_effect_info &info, const double *shape);

// Whitened copy (rows at the heads of runs are zero).
Eigen::VectorXd whiten(const Equation &equation, const Eigen::VectorXd &raw);
Eigen::MatrixXd whiten(const Equation &equation, const Eigen::MatrixXd &raw);
void fit_whitening(Equation &equation, const Eigen::VectorXd &residual, int order);
void weigh_rows(Equation &equation);
// RMS over the rows of the training records, or of those held out.
double rms_where(const Equation &equation, const Eigen::VectorXd &residual, bool held_out);

void mask_outliers(Equation &equation, const Eigen::VectorXd &residual);

// The target with the input shifted by a further delay_s (positive: the response comes later than the input).
Eigen::VectorXd delayed_target(const Equation &equation, double delay_s);

struct EquationSet {
  std::vector<Equation> equation;
  std::vector<Notice> notices;
  std::string bad;                 // cannot answer, and what to record
};

// All equations that the model has on these records. Records are training first, then held out.
EquationSet make_equations(const driveid_model &model, const std::vector<Prepared> &training, const std::vector<Prepared> &held_out);

}  // namespace driveid::diagnose
