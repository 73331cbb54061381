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
  const int n = int(seconds / dt), fine = 200;
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
    const double h = dt / fine;
    for (int j = 0; j < fine; j++) {
      const double drive = d.K_t * i - d.B * w - d.tau_0 - d.cogging * std::sin(d.order * th);
      const double before = w;
      if (w == 0) {
        if (std::fabs(drive) > d.tau_c) w = h * (drive - std::copysign(d.tau_c, drive)) / d.J;
      } else {
        const double next = w + h * (drive - std::copysign(d.tau_c, w)) / d.J;
        w = next * w <= 0 ? 0 : next;
      }
      th += 0.5 * h * (before + w);   // second order: a shift of half a step would already be seen
    }
  }
  return r;
}

}  // namespace records
