// SPDX-License-Identifier: Apache-2.0
// The record that would decide: the separating motion of the catalogue, put into numbers of this drive.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "diagnose/explain.hpp"

namespace driveid::diagnose {
namespace {

using nlohmann::ordered_json;

struct Reach {
  double speed = 1, accel = 1, drive = 1, span = 10;
  bool linear = false;
};

Reach reach_of(const Explanation &x) {
  Reach r;
  r.speed = r.accel = r.drive = 0;
  for (const Analysis &a : x.analysis) {
    const Equation &e = a.search->equation();
    r.linear |= e.frame == DRIVEID_FRAME_FORCE || e.frame == DRIVEID_FRAME_AMPERE_LINEAR;
    for (const Track &t : e.tracks)
      for (std::size_t k = 0; k < t.row.size(); k += 2) {
        const auto &s = t.state[std::size_t(t.row[k])];
        r.speed = std::max(r.speed, std::fabs(s.speed));
        r.accel = std::max(r.accel, std::fabs(s.accel));
        if (!e.electrical) r.drive = std::max(r.drive, std::fabs(s.drive));
      }
  }
  return r;
}

class Table {
 public:
  explicit Table(const Reach &r) : reach_(r) {}
  void hold(double speed, double seconds) {
    const double ramp = std::max(0.05, std::fabs(speed - last_) / std::max(1e-9, 0.6 * reach_.accel));
    t_ += ramp;
    row(speed);
    t_ += seconds;
    row(speed);
    last_ = speed;
  }
  void rest(double seconds) { hold(0, seconds); }
  ordered_json json() const { return rows_; }

 private:
  void row(double speed) {
    rows_.push_back({{"t_s", std::round(t_ * 1000) / 1000}, {reach_.linear ? "v_m_s" : "omega_rad_s", speed}});
  }
  Reach reach_;
  double t_ = 0, last_ = 0;
  ordered_json rows_ = ordered_json::array();
};

bool any(const std::vector<std::string> &names, std::initializer_list<const char *> of) {
  for (const char *n : of)
    if (std::find(names.begin(), names.end(), n) != names.end()) return true;
  return false;
}

}  // namespace

nlohmann::ordered_json next_record(const Explanation &x) {
  const Reach r = reach_of(x);
  std::vector<std::string> names;
  std::string motion, why;
  Table table(r);
  const Ranked *first = nullptr;
  for (const Ranked &k : x.ranked)
    if (k.accepted && !first) first = &k;
  if (first) {
    names.push_back(first->effect);
    names.insert(names.end(), first->ties.begin(), first->ties.end());
  }
  if (x.verdict == "unknown" || names.empty()) {
    motion = "the whole range of position and speed: slow there and back over the whole travel, then the same at a third, two thirds and all of the speed, then rests at both ends";
    why = x.verdict == "unknown" ? "the unexplained part can then be laid out over speed, position and direction" : "a record that visits every regime would show what this one cannot";
    for (double s : {0.05, 0.33, 0.67, 1.0}) table.hold(s * r.speed, 4), table.hold(-s * r.speed, 4);
    table.rest(2);
  } else {
    const driveid_effect_info *info = driveid_effect_find(names[0].c_str());
    motion = info && info->separated_by ? info->separated_by : "a motion that visits slow and fast speeds in both directions";
    why = names.size() > 1 ? "it would decide between " + names[0] : "it would confirm " + names[0];
    for (std::size_t k = 1; k < names.size(); ++k) why += (k + 1 == names.size() ? " and " : ", ") + names[k];
    if (any(names, {"constant_load", "current_offset"}) && names.size() > 1) {
      table.rest(3);
      for (double s : {0.3, -0.3, 0.8, -0.8}) table.hold(s * r.speed, 3);
      table.rest(3);
    } else if (any(names, {"stribeck", "lugre", "coulomb", "hysteresis", "asymmetric_friction", "eccentric_friction", "dead_zone"})) {
      for (double s : {0.01, 0.03, 0.1, 0.3, 1.0}) table.hold(s * r.speed, 3), table.hold(-s * r.speed, 3);
      table.rest(1);
    } else if (any(names, {"cogging", "torque_ripple", "gravity_unbalance", "encoder_eccentricity"})) {
      for (double s : {0.02, 0.1, 0.4}) table.hold(s * r.speed, 5), table.hold(-s * r.speed, 5);
    } else if (any(names, {"delay", "compliance", "backlash", "inertia_change", "torque_saturation", "load_dependent_friction"})) {
      for (int k = 0; k < 6; ++k) table.hold((k % 2 ? -1 : 1) * r.speed * (0.15 + 0.15 * k), 0.4);
      table.rest(1);
    } else {
      for (double s : {0.33, 0.67, 1.0}) table.hold(s * r.speed, 3), table.hold(-s * r.speed, 3);
    }
  }
  return {{"motion", motion}, {"why", why}, {"separates", names}, {"set_points", table.json()}};
}

}  // namespace driveid::diagnose
