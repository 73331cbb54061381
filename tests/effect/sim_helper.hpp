// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include <driveid/simulate.h>

#include "plant.hpp"

namespace helper {

using Values = std::vector<std::pair<const char *, double>>;

inline void add(driveid_model &m, const char *effect, const Values &values) {
  char reason[256];
  ASSERT_EQ(driveid_model_add(&m, effect, nullptr, nullptr, reason, sizeof reason), DRIVEID_OK) << reason;
  driveid_effect_use &use = m.effect[m.effects - 1];
  for (const auto &[name, value] : values) {
    bool found = false;
    for (uint32_t k = 0; k < use.params; k++)
      if (std::string(use.param[k].name) == name) use.param[k].state = DRIVEID_PARAM_FREE, use.param[k].value = value, found = true;
    ASSERT_TRUE(found) << name;
  }
}

inline driveid_model rigid(double J, double B) {  // torque measured
  driveid_model m;
  driveid_model_init(&m, DRIVEID_STRUCTURE_RIGID_AXIS);
  driveid_model_give(&m, "J_kgm2", J);
  driveid_model_give(&m, "B_Nms_rad", B);
  return m;
}

inline driveid_sim_record record(const plant::Run &r, driveid_hold hold = DRIVEID_HOLD_ZERO) {
  driveid_sim_record rec = {};
  rec.rows = r.t.size();
  rec.t_s = r.t.data();
  rec.signal[DRIVEID_SIGNAL_TAU_NM] = r.u.data();
  rec.signal[DRIVEID_SIGNAL_THETA_RAD] = r.angle.data();
  rec.signal[DRIVEID_SIGNAL_OMEGA_RAD_S] = r.speed.data();
  rec.hold = hold;
  return rec;
}

// Largest difference of angle, relative to the largest angle.
inline double worst(const driveid_model &m, const plant::Run &r, driveid_hold hold = DRIVEID_HOLD_ZERO) {
  const driveid_sim_record rec = record(r, hold);
  std::vector<double> angle(rec.rows), speed(rec.rows);
  double *out[DRIVEID_SIGNAL_COUNT] = {};
  out[DRIVEID_SIGNAL_THETA_RAD] = angle.data();
  out[DRIVEID_SIGNAL_OMEGA_RAD_S] = speed.data();
  char message[256];
  const driveid_status s = driveid_simulate(&m, &rec, out, message, sizeof message);
  EXPECT_EQ(s, DRIVEID_OK) << message;
  double top = 0, size = 0;
  for (size_t k = 0; k < rec.rows; k++) top = std::max(top, std::fabs(angle[k] - r.angle[k])), size = std::max(size, std::fabs(r.angle[k]));
  return top / size;
}

}  // namespace helper
