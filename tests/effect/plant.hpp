// SPDX-License-Identifier: Apache-2.0
// Independent truth for the simulation tests: explicit integration with a very small step, written from the textbook
// equations of CONTRACT; shares nothing with lib/model or lib/effect.
#pragma once

#include <cmath>
#include <functional>
#include <vector>

namespace plant {

struct Run {
  std::vector<double> t, u, angle, speed;
};

// Input: smooth sum of sines plus steps, strong enough to reverse and to stop.
inline double input(double t, double size) {
  const double square = std::fmod(t, 0.4) < 0.2 ? 1.0 : -1.0;
  return size * (0.5 * square + 0.4 * std::sin(2 * M_PI * 1.3 * t) + 0.15 * std::sin(2 * M_PI * 7 * t + 1));
}

// J w' = u - B w - smooth(angle, w, t, u) - sign-like friction: level(angle, w, side, t, u) >= 0 on the side of motion. u is held over a sample.
struct Axis {
  double J = 1e-4, B = 2e-5;
  std::function<double(double, double, double, double)> smooth;          // angle, speed, t, u
  std::function<double(double, double, int, double, double)> level;      // angle, speed, side, t, u
};

inline Run run(const Axis &p, double seconds, double dt, double size, int fine = 400) {
  Run r;
  double th = 0, w = 0;
  const int n = static_cast<int>(std::lround(seconds / dt));
  for (int k = 0; k < n; k++) {
    const double u = input(k * dt, size);
    r.t.push_back(k * dt), r.u.push_back(u), r.angle.push_back(th), r.speed.push_back(w);
    const double h = dt / fine;
    for (int j = 0; j < fine; j++) {
      const double t = k * dt + j * h;
      const double free = u - p.B * w - (p.smooth ? p.smooth(th, w, t, u) : 0.0);
      if (!p.level) {
        w += h * free / p.J;
      } else if (w == 0.0) {
        const double up = p.level(th, 0.0, 1, t, u), down = p.level(th, 0.0, -1, t, u);
        if (free > up) w = h * (free - up) / p.J;
        else if (free < -down) w = h * (free + down) / p.J;
      } else {
        const int side = w > 0 ? 1 : -1;
        const double next = w + h * (free - side * p.level(th, w, side, t, u)) / p.J;
        w = next * side <= 0 ? 0.0 : next;
      }
      th += h * w;
    }
  }
  return r;
}

}  // namespace plant
