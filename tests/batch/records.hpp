// SPDX-License-Identifier: Apache-2.0
// Records with a known truth: a drive in closed loop, integrated with a small step, written from the textbook; shares nothing with the library.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <random>
#include <string>
#include <vector>

#include <driveid/diagnose.h>

namespace records {

struct Record {
  std::string name = "simulated";
  std::vector<int64_t> t;
  std::map<std::string, std::vector<double>> column;
  std::vector<driveid_column> list;
  const char *hold = "zoh";
  driveid_record get() {
    list.clear();
    for (auto &[n, v] : column) list.push_back({n.c_str(), v.data()});
    return {name.c_str(), nullptr, hold, t.size(), list.size(), t.data(), list.data()};
  }
};

struct Drive {
  double J = 1.2e-4, B = 3e-5, tau_c = 0.012, tau_0 = 0.004, K_t = 0.05;
  double angle_noise = 2e-5, reading_noise = 0;   // of the sensors
  double cogging = 0, order = 7;
};

// One small step; a reversal is found inside it: time lost at each of them would be seen against an angle noise of some microradians.
inline void advance(const Drive &d, double i, double left, double &th, double &w) {
  for (int events = 0; events < 4 && left > 0; events++) {
    auto drive = [&](double angle, double speed) { return d.K_t * i - d.B * speed - d.tau_0 - d.cogging * std::sin(d.order * angle); };
    const double free = drive(th, w);
    if (w == 0 && std::fabs(free) <= d.tau_c) return;
    const double friction = std::copysign(d.tau_c, w == 0 ? free : w), first = (free - friction) / d.J;
    const double a = (drive(th + 0.5 * left * (w + 0.25 * left * first), w + 0.5 * left * first) - friction) / d.J;
    const double taken = w * (w + a * left) < 0 ? -w / a : left;
    th += taken * (w + 0.5 * taken * a);
    w = taken < left ? 0 : w + a * left;
    left -= taken;
  }
}

// Position loop follows a random sum of slow sines with rests; current command held over a sample; logged: what was commanded plus its noise.
inline Record closed_loop(const Drive &d, double seconds, double dt, uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> u(0, 1);
  double f[4], a[4], p[4];
  for (int k = 0; k < 4; k++) f[k] = 0.15 + 1.2 * u(random), a[k] = 2 + 4 * u(random), p[k] = 6.28 * u(random);
  Record r;
  double th = 0, w = 0, integral = 0;
  auto &angle = r.column["theta_rad"], &current = r.column["i_A"];
  const int n = int(seconds / dt), fine = 20;
  for (int k = 0; k < n; k++) {
    const double t = k * dt, envelope = std::fmod(t, 5.0) < 4.3 ? 1.0 : 0.0;
    double goal = 0;
    for (int j = 0; j < 4; j++) goal += a[j] * std::sin(2 * M_PI * f[j] * (std::fmod(t, 5.0) < 4.3 ? t : std::floor(t / 5) * 5 + 4.3) + p[j]);
    const double read = th + d.angle_noise * normal(random);
    integral += dt * (goal - read);
    const double i = std::max(-4.0, std::min(4.0, 0.6 * (goal - read) - 0.02 * w + 0.5 * integral * envelope));
    r.t.push_back(int64_t(std::llround(t * 1e9)));
    angle.push_back(read);
    current.push_back(i + d.reading_noise * normal(random));
    for (int j = 0; j < fine; j++) advance(d, i, dt / fine, th, w);
  }
  return r;
}

}  // namespace records
