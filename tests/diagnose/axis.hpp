// SPDX-License-Identifier: Apache-2.0
// A small drive of the tests' own: J w' = tau - B w - loss, integrated at a fifth of a millisecond with a stiction state, driven
// by a speed loop along a given profile. Shares no code with the library.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include <driveid/diagnose.h>

struct Axis {
  double J = 2e-4, B = 3e-4, K_t = 0.08, coulomb = 0, load = 0, drag = 0, cogging = 0, dead_zone_A = 0;
  int order = 12;
  double sigma_i = 0.01, counts = 16384;
};

struct Log {
  std::vector<std::int64_t> t_ns;
  std::vector<double> i_A, theta_rad;
  std::vector<driveid_column> columns;
  driveid_record record{};
  void seal(const char *name) {
    columns = {{"i_A", i_A.data()}, {"theta_rad", theta_rad.data()}};
    record = {name, nullptr, nullptr, t_ns.size(), columns.size(), t_ns.data(), columns.data()};
  }
};

inline Log run_axis(const Axis &a, double seconds, unsigned seed, double rate_Hz = 500) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal;
  const double h = 2e-4, dt = 1 / rate_Hz, pi = 3.14159265358979;
  const int every = int(dt / h + 0.5);
  std::vector<double> level;
  for (int k = 0; k < 200; ++k) level.push_back((k % 5 == 4 ? 0 : 1) * 60 * std::sin(2.4 * k + seed) * (k % 3 == 0 ? 0.15 : 1));
  double w = 0, q = 0, target = 0, integral = 0, i = 0;
  Log log;
  for (std::int64_t n = 0; double(n) * h < seconds; ++n) {
    double t = double(n) * h;
    target += (level[std::size_t(t / 0.35) % level.size()] - target) * h / 0.03;
    double e = target - w;
    integral += e * h;
    if (n % every == 0) {
      i = 0.012 / a.K_t * e + 0.25 / a.K_t * integral;
      log.t_ns.push_back(std::int64_t(t * 1e9 + 0.5));
      log.i_A.push_back(i + a.sigma_i * normal(rng));
      log.theta_rad.push_back(std::floor(q / (2 * pi) * a.counts) * 2 * pi / a.counts);
    }
    const double through = i - std::fmax(-a.dead_zone_A, std::fmin(a.dead_zone_A, i));
    double free = a.K_t * through - a.load - a.cogging * std::sin(a.order * q + 0.7);
    if (w == 0 && std::fabs(free) <= a.coulomb) continue;
    double side = w != 0 ? (w > 0 ? 1 : -1) : (free > 0 ? 1 : -1);
    double next = w + h * (free - a.B * w - a.drag * std::fabs(w) * w - a.coulomb * side) / a.J;
    if (w != 0 && next * w < 0 && std::fabs(free) <= a.coulomb) next = 0;
    q += 0.5 * h * (w + next);
    w = next;
  }
  return log;
}
