// SPDX-License-Identifier: Apache-2.0
// Record preparation, one place for every command: a raw record (columns and stamps as logged) becomes contiguous
// pieces on a uniform grid, with glitches mended and everything noticed on the way written down.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include <driveid/diagnose.h>
#include <driveid/model.h>

namespace driveid::diagnose {

// Something about the data that a user should know: kind is a short fixed word ("gap", "glitch", "units", ...).
struct Notice {
  std::string kind, text, record;
};

// One contiguous stretch on a uniform grid; every signal has n values, SI, by its column name.
struct Piece {
  double t0_s = 0;             // since the first row of the record
  std::size_t n = 0;
  std::map<std::string, std::vector<double>> signal;
  std::vector<unsigned char> filled;  // 1 where the sample was interpolated (row lost)
  Piece part(std::size_t from, std::size_t to, double dt_s) const;
};

struct SignalQuality {
  double noise = 0;   // standard deviation of the sample-to-sample noise, SI
  double quantum = 0; // quantisation step, 0 where none was seen
  double lo = 0, hi = 0;
  bool constant = false;
  bool clipped[2] = {false, false};   // stands at lo, at hi
};

struct Prepared {
  std::string name, hash;
  std::size_t rows = 0;
  double span_s = 0, dt_s = 0;
  std::string hold;             // as told by the caller: "average" | "zoh" | "instant" | "" (to be detected)
  std::vector<Piece> pieces;
  std::map<std::string, SignalQuality> quality;
  std::vector<Notice> notices;
  std::string bad;              // not empty: the record cannot answer, and why, and what to record
  double speed_lag_s = 0;       // lag of the speed column behind the derivative of the angle, where both are there
  bool has(const std::string &signal) const { return quality.count(signal) > 0; }
};

// The column names that play each part for a structure, in order of preference.
struct Roles {
  std::string position, speed, input;   // mechanical: "theta_rad"/"x_m", "omega_rad_s"/"v_m_s", "tau_Nm"/"F_N"/"i_q_A"/"i_A"/"v_V"
  double input_gain = 1;                // input column * gain = torque or force, where known; else 1
  std::string effort_unit;              // unit of the mechanical equation: "N m", "N", "A", "V"
  bool per_ampere = false;              // mechanical parameters are per ampere (no torque constant is known)
};

Roles roles_of(const driveid_model &model, const Prepared &record);

// Prepares the record; never throws on bad data (see Prepared::bad).
Prepared prepare(const driveid_record &record, const driveid_model &model);

// First-order filter that a drive laid over its differenced counts, per sample (record_filter.cpp); 0: none is seen.
double filter_ratio(const Prepared &record, const std::string &speed);
void undo_filter(Prepared &record, const std::string &speed, double ratio);

}  // namespace driveid::diagnose
