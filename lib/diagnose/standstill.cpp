// SPDX-License-Identifier: Apache-2.0
// A column that stays within its own noise says nothing, although it is never twice the same.
#include "diagnose/standstill.hpp"

#include <algorithm>
#include <cmath>

namespace driveid::diagnose {
namespace {

constexpr double kSteps = 2.5;        // quantisation steps that an axis holding its place goes to and fro
constexpr double kDeviations = 10;    // range of some thousand means of noise, in deviations of a mean

// Range of the means over so many rows; about zero where the signal has a rest of its own.
double travel(const Prepared &record, const std::string &name, std::size_t length, bool about_zero) {
  double lo = about_zero ? 0 : INFINITY, hi = about_zero ? 0 : -INFINITY;
  for (const Piece &p : record.pieces) {
    const std::vector<double> &x = p.signal.at(name);
    for (std::size_t a = 0; a + length <= x.size(); a += length) {
      double sum = 0;
      for (std::size_t k = a; k < a + length; ++k) sum += x[k];
      lo = std::min(lo, sum / double(length)), hi = std::max(hi, sum / double(length));
    }
  }
  return hi > lo ? hi - lo : 0;
}

bool is_noise(const Prepared &record, const std::string &name, std::initializer_list<std::size_t> lengths, double least, bool about_zero) {
  const SignalQuality &q = record.quality.at(name);
  if (!std::isfinite(q.noise)) return false;   // numbers beyond all measure
  for (std::size_t length : lengths)
    if (travel(record, name, length, about_zero) > std::max(least, kDeviations * q.noise / std::sqrt(double(length)))) return false;
  return true;
}

}  // namespace

std::string standstill(const Prepared &record, const Roles &roles) {
  const bool by_position = !roles.position.empty();
  const std::string &moving = by_position ? roles.position : roles.speed;
  if (moving.empty() || roles.input.empty()) return "";
  const SignalQuality &motion = record.quality.at(moving), &input = record.quality.at(roles.input);
  // A position is asked over short means alone, for it may drift; differenced counts say their speed over long ones.
  const bool rests = by_position ? is_noise(record, moving, {4}, kSteps * motion.quantum, false) : is_noise(record, moving, {4, 16, 64, 256}, 0, true);
  if (motion.constant || rests) return moving + (motion.constant ? " never changes" : " stays within its noise") + ": the axis does not move in this record; record a motion with accelerations in both directions";
  if (input.constant || is_noise(record, roles.input, {4, 16, 64, 256}, 0, false))
    return roles.input + (input.constant ? " never changes" : " stays within its noise") + ": record a motion with accelerations in both directions";
  return "";
}

}  // namespace driveid::diagnose
