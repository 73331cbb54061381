// SPDX-License-Identifier: Apache-2.0
// Parts that the mechanical and the electrical equations are built from.
#pragma once

#include <string>
#include <vector>

#include "diagnose/equation.hpp"

namespace driveid::diagnose {

struct Source {
  const Prepared *record;
  int index;
  bool held_out;
  Roles roles;
};

struct Fine {   // smoothed kinematics of a piece
  std::vector<double> position, speed, accel, raw_speed;
  double speed_noise = 0;
  std::vector<double> direction;   // -1 .. 1
  std::vector<double> still;       // share of the sample inside a short rest between two motions
};

const driveid_param *parameter(const driveid_model &model, const char *name);
std::vector<double> convolve_all(const std::vector<double> &x, const Kernel &kernel, int derivative);
double norm2(const std::vector<double> &w);
double choose_width(const Source &source);   // half width of the kernel, s
Fine kinematics(const Source &source, const Piece &piece, double dt, const Kernel &wide, const Kernel &narrow);
std::vector<unsigned char> rests(const Fine &fine, const Source &source, double dt, int half);
void fill_states(Track &track, const Piece &piece, const Fine &fine, const std::vector<double> &drive, double gain, double shift_s, const std::vector<double> &current,
                 const std::vector<double> *temperature, bool electrical, double resistance);
void place_rows(Track &track, const Piece &piece, int step, bool skip_rests, int &run);
int row_step(const std::vector<Source> &sources, double width_s);
const std::vector<double> *temperature_of(const Piece &piece);

// Once the tracks stand: stacked target, base columns, hold of the input, blocks.
void finish(Equation &equation);
void add_column(Equation &equation, const driveid_model &model, const char *name, const Eigen::VectorXd &column);
void add_base(Equation &equation, const driveid_model &model, const char *name, const FineSignal &signal, int derivative, double sign = 1);
void settle(Equation &equation, const Source &source, std::vector<Notice> &notices);

// The direction inside short rests, where the axis has enough dry friction to hold it.
void hold_by_friction(Equation &equation);

Equation dc_voltage(const driveid_model &model, const std::vector<Source> &sources, std::vector<Notice> &notices);
Equation dq_voltage(const driveid_model &model, const std::vector<Source> &sources, std::vector<Notice> &notices);

}  // namespace driveid::diagnose
