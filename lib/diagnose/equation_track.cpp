// SPDX-License-Identifier: Apache-2.0
// From a piece of a record to a track: kernel width, smoothed motion, rests, states, rows.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "diagnose/equation_build.hpp"

namespace driveid::diagnose {
namespace {

constexpr std::size_t kRowsMax = 24000;  // rows of one equation

}  // namespace

std::vector<double> convolve_all(const std::vector<double> &x, const Kernel &k, int derivative) {
  const std::ptrdiff_t n = std::ptrdiff_t(x.size()), h = k.half;
  std::vector<double> out(x.size(), 0.0);
  const double *w = k.w[derivative].data();
  for (std::ptrdiff_t c = h; c + h < n; ++c) {
    double sum = 0, centre = derivative ? x[std::size_t(c)] : 0;
    for (std::ptrdiff_t i = -h; i <= h; ++i) sum += w[i + h] * (x[std::size_t(c + i)] - centre);
    out[std::size_t(c)] = sum;
  }
  for (std::ptrdiff_t c = 0; c < std::min(h, n); ++c) out[std::size_t(c)] = n > 2 * h ? out[std::size_t(h)] : x[std::size_t(c)];
  for (std::ptrdiff_t c = std::max<std::ptrdiff_t>(0, n - h); c < n; ++c) out[std::size_t(c)] = n > 2 * h ? out[std::size_t(n - h - 1)] : x[std::size_t(c)];
  return out;
}

double norm2(const std::vector<double> &w) {
  double s = 0;
  for (double v : w) s += v * v;
  return std::sqrt(s);
}

// Half width (s) that leaves the acceleration with at most 1 % noise power: at least 12 ms (drives do little above 50 Hz) and 4 samples,
// at most 80 ms or 8 samples.
double choose_width(const Source &s) {
  const Prepared &r = *s.record;
  const bool from_speed = s.roles.position.empty();
  const std::string &name = from_speed ? s.roles.speed : s.roles.position;
  const double sigma = r.quality.at(name).noise;
  const int most = std::max(8, int(0.08 / r.dt_s)), least = std::max(4, int(0.012 / r.dt_s + 0.5));
  static const int widths[] = {4, 5, 6, 8, 10, 12, 15, 18, 22, 27, 33, 40, 50, 60, 75, 90, 110, 135, 165, 200, 250, 320, 400};
  int best = least;
  for (int h : widths) {
    if (h < least && h < most) continue;
    if (h > most) break;
    best = h;
    Kernel k = make_kernel(h, r.dt_s);
    double noise = sigma * norm2(k.w[from_speed ? 1 : 2]), sum = 0;
    std::size_t count = 0;
    for (const Piece &p : r.pieces) {
      const auto &x = p.signal.at(name);
      for (std::size_t c = std::size_t(h); c + std::size_t(h) < p.n; c += std::size_t(std::max(1, h / 2))) {
        double a = 0;
        for (int i = -h; i <= h; ++i) a += k.w[from_speed ? 1 : 2][std::size_t(i + h)] * (x[std::size_t(std::ptrdiff_t(c) + i)] - x[c]);
        sum += a * a;
        ++count;
      }
    }
    double power = count ? sum / double(count) : 0;
    if (noise * noise < 0.01 * std::max(0.0, power - noise * noise)) break;
  }
  return best * r.dt_s;
}

namespace {

struct Turning {   // the speed that says when the motion turns round
  std::vector<double> own;   // by a narrower kernel, where one is used
  double noise;
  int half;
};

// The narrowest kernel whose noise moves a turn less than its width does.
Turning turning_speed(const Fine &f, double sigma, double dt, const Kernel &narrow) {
  const bool from_speed = !f.raw_speed.empty();
  Turning t{{}, sigma * norm2(narrow.w[from_speed ? 0 : 1]), narrow.half};
  std::vector<double> accel;
  const auto reach = std::size_t(2 * narrow.half);
  for (std::size_t k = 1; k < f.speed.size(); ++k)
    if ((f.speed[k] > 0) != (f.speed[k - 1] > 0) && k >= reach && k + reach < f.speed.size() && std::min(std::fabs(f.speed[k - reach]), std::fabs(f.speed[k + reach])) > 4 * t.noise)
      accel.push_back(std::fabs(f.accel[k]));   // a turn, not noise at rest
  if (accel.empty()) return t;
  auto mid = accel.begin() + std::ptrdiff_t(accel.size() / 2);
  std::nth_element(accel.begin(), mid, accel.end());
  for (int half : {3, 4, 5, 6, 8, 10, 12, 15, 18, 22}) {
    if (half >= narrow.half) break;
    const Kernel k = make_kernel(half, dt);
    const double noise = sigma * norm2(k.w[from_speed ? 0 : 1]);
    if (noise > 0.15 * half * dt * *mid) continue;
    t.own = convolve_all(from_speed ? f.raw_speed : f.position, k, from_speed ? 0 : 1);
    t.noise = noise;
    t.half = half;
    break;
  }
  return t;
}

// Dry friction breaks the speed's slope where the motion turns round; smoothing over the break moves the turn towards the flatter side.
// Both slopes, taken from outside the break and drawn on to zero, meet it: at one instant, or at the two ends of a short rest, over which
// friction goes from one side to the other.
void place_turn(const std::vector<double> &v, const Turning &t, std::size_t at, std::vector<double> &direction) {
  const auto near = std::ptrdiff_t(std::lround(0.6 * t.half)), far = 2 * near, c = std::ptrdiff_t(at), n = std::ptrdiff_t(v.size());
  if (c - far < 0 || c + far >= n) return;
  for (std::ptrdiff_t k = c - far; k <= c + far; ++k)
    if ((v[std::size_t(k)] > 0) != (v[std::size_t(k < c ? c - 1 : c)] > 0)) return;   // another turn close by
  double zero[2], slope[2];
  for (int side = 0; side < 2; ++side) {
    const std::ptrdiff_t a = side ? c + near : c - near, b = side ? c + far : c - far;
    slope[side] = (v[std::size_t(b)] - v[std::size_t(a)]) / double(b - a);
    if (slope[side] == 0 || 3 * t.noise > 0.5 * t.half * std::fabs(slope[side])) return;   // drowned in noise
    zero[side] = double(a) - v[std::size_t(a)] / slope[side];
  }
  if (slope[0] * slope[1] <= 0 || std::fabs(zero[0] - zero[1]) > t.half || std::fabs(0.5 * (zero[0] + zero[1]) - double(c)) > t.half) return;
  if (zero[0] > zero[1]) zero[0] = zero[1] = (slope[0] * slope[0] * zero[0] + slope[1] * slope[1] * zero[1]) / (slope[0] * slope[0] + slope[1] * slope[1]);
  const double before = v[at - 1] > 0 ? 1 : -1, middle = 0.5 * (zero[0] + zero[1]), width = std::max(1.0, zero[1] - zero[0]);
  for (std::ptrdiff_t k = c - t.half; k <= c + t.half; ++k)
    if (k >= 0 && k < n) direction[std::size_t(k)] = before * std::clamp(-2 * (double(k) - middle) / width, -1.0, 1.0);
}

// Short rests inside a motion: the speed stays within its noise for much longer than it would take to pass.
void mark_stills(const std::vector<double> &v, double limit, std::ptrdiff_t half, std::vector<double> &still) {
  const auto n = std::ptrdiff_t(v.size()), reach = half + 2;
  for (std::ptrdiff_t a = 0, b; a < n; a = b + 1) {
    b = a;
    if (!(std::fabs(v[std::size_t(a)]) < limit)) continue;
    while (b + 1 < n && std::fabs(v[std::size_t(b) + 1]) < limit) ++b;
    if (a < reach || b + reach >= n) continue;
    const double rate = std::min(std::fabs(v[std::size_t(a - reach)]), std::fabs(v[std::size_t(b + reach)])) / double(reach);
    if (b - a < 2 || double(b - a + 1) * rate <= 4 * limit) continue;
    // The kernel rounds the stop off: the slope before it, drawn on to zero, tells its instant.
    const std::ptrdiff_t near = a - half - 1, far = near - 2;
    const double slope = far >= 0 ? 0.5 * (v[std::size_t(near)] - v[std::size_t(far)]) : 0, stop = slope != 0 ? double(near) - v[std::size_t(near)] / slope : -1;
    const std::ptrdiff_t from = std::fabs(stop - double(a)) <= double(half) ? std::lround(stop) : a;
    std::fill(still.begin() + from, still.begin() + b + 1, 1.0);
    if (from == std::lround(stop)) still[std::size_t(from)] = std::clamp(double(from) + 0.5 - stop, 0.01, 1.0);   // the rest begins within this sample
  }
}

std::vector<double> stills(const Fine &f, double sigma, double dt, int widest) {
  const bool from_speed = !f.raw_speed.empty();
  std::vector<double> still(f.speed.size(), 0);
  for (int half : {3, 5, 8}) {
    if (half > widest) break;
    const Kernel k = make_kernel(half, dt);
    mark_stills(convolve_all(from_speed ? f.raw_speed : f.position, k, from_speed ? 0 : 1), 3 * sigma * norm2(k.w[from_speed ? 0 : 1]), half, still);
  }
  return still;
}

std::vector<double> directions(const Fine &f, const Turning &t) {
  std::vector<double> v = f.speed, direction(v.size());
  if (!t.own.empty())
    for (std::size_t k = 0; k < v.size(); ++k)
      if (std::fabs(t.own[k]) > 2 * t.noise) v[k] = t.own[k];
  for (std::size_t k = 0; k < v.size(); ++k) {
    const double a = k ? 0.5 * (v[k] + v[k - 1]) : v[k], b = k + 1 < v.size() ? 0.5 * (v[k] + v[k + 1]) : v[k];
    if ((a > 0) == (b > 0)) direction[k] = a > 0 ? 1 : -1;
    else direction[k] = (std::fabs(b) * (b > 0 ? 1 : -1) + std::fabs(a) * (a > 0 ? 1 : -1)) / std::max(1e-300, std::fabs(a) + std::fabs(b));
  }
  for (std::size_t k = 1; k < v.size(); ++k)
    if ((v[k] > 0) != (v[k - 1] > 0)) place_turn(v, t, k, direction);
  return direction;
}

}  // namespace

Fine kinematics(const Source &s, const Piece &p, double dt, const Kernel &wide, const Kernel &narrow) {
  Fine f;
  if (!s.roles.position.empty()) {
    f.position = p.signal.at(s.roles.position);
    f.speed = convolve_all(f.position, narrow, 1);
    f.accel = convolve_all(f.position, wide, 2);
    f.speed_noise = s.record->quality.at(s.roles.position).noise * norm2(narrow.w[1]);
  } else {
    f.raw_speed = p.signal.at(s.roles.speed);
    f.speed = convolve_all(f.raw_speed, narrow, 0);
    f.accel = convolve_all(f.raw_speed, wide, 1);
    f.speed_noise = s.record->quality.at(s.roles.speed).noise * norm2(narrow.w[0]);
    f.position.assign(p.n, 0.0);
    for (std::size_t k = 1; k < p.n; ++k) f.position[k] = f.position[k - 1] + 0.5 * dt * (f.raw_speed[k] + f.raw_speed[k - 1]);
  }
  const SignalQuality &q = s.record->quality.at(s.roles.position.empty() ? s.roles.speed : s.roles.position);
  const double sigma = std::max(q.noise, 0.3 * q.quantum);
  f.direction = directions(f, turning_speed(f, sigma, dt, narrow));
  f.still = stills(f, sigma, dt, narrow.half);
  return f;
}

// Rest: the smoothed speed stays inside its own noise for at least a kernel's width.
std::vector<unsigned char> rests(const Fine &f, const Source &s, double dt, int half) {
  std::vector<unsigned char> rest(f.speed.size(), 0);
  double quantum = s.roles.position.empty() ? 0 : s.record->quality.at(s.roles.position).quantum;
  double limit = std::max(4 * f.speed_noise, 0.7 * quantum / (double(half) * dt));
  std::size_t a = 0;
  const std::size_t n = f.speed.size();
  for (std::size_t k = 0; k <= n; ++k) {
    bool slow = k < n && std::fabs(f.speed[k]) < limit;
    if (slow) continue;
    if (k - a >= std::size_t(std::max(4, half))) std::fill(rest.begin() + std::ptrdiff_t(a), rest.begin() + std::ptrdiff_t(k), 1);
    a = k + 1;
  }
  return rest;
}

void fill_states(Track &t, const Piece &p, const Fine &f, const std::vector<double> &drive, double gain, double shift_s, const std::vector<double> &current,
                 const std::vector<double> *temperature, bool electrical, double resistance) {
  const std::size_t n = p.n;
  t.state.assign(n, driveid_effect_state{});
  const double shift = shift_s / t.dt_s, whole = std::floor(shift), part = shift - whole;
  for (std::size_t k = 0; k < n; ++k) {
    driveid_effect_state &s = t.state[k];
    s.t_s = p.t0_s + double(k) * t.dt_s;
    s.dt_s = k ? t.dt_s : 0;
    if (!f.speed.empty()) {
      s.angle = f.position[k];
      s.speed = f.speed[k];
      s.accel = f.accel[k];
      s.direction = f.direction[k];
    }
    auto at = [&](double index) { return drive[std::size_t(std::clamp(index, 0.0, double(n - 1)))]; };
    s.drive = (1 - part) * at(double(k) - whole) + part * at(double(k) - whole - 1);
    s.gain = gain;
    s.torque = gain * s.drive;
    s.current_A = current.empty() ? 0 : current[k];
    s.resistance_ohm = resistance;
    s.electrical = electrical;
    if (temperature) s.T_degC = (*temperature)[k], s.has_temperature = 1;
  }
}

// Rows a third of the half width apart, away from the ends, from rests and from long fills.
void place_rows(Track &t, const Piece &p, int step, bool skip_rests, int &run) {
  const int n = int(p.n), half = t.kernel.half, margin = 2 * half + 2;
  std::vector<int> bad(p.n + 1, 0);
  int filled = 0;
  for (int k = 0; k < n; ++k) {
    filled = p.filled[std::size_t(k)] ? filled + 1 : 0;
    bool b = filled >= 3 || (skip_rests && t.rest[std::size_t(k)]);
    bad[std::size_t(k) + 1] = bad[std::size_t(k)] + b;
  }
  ++run;
  bool open = false;
  for (int c = margin; c < n - margin; c += step) {
    if (bad[std::size_t(c + half + 1)] - bad[std::size_t(c - half)] > 0) {
      if (open) ++run;
      open = false;
      continue;
    }
    open = true;
    t.row.push_back(c);
    t.run.push_back(run);
  }
}

int row_step(const std::vector<Source> &sources, double width_s) {
  std::size_t total = 0;
  double dt = sources[0].record->dt_s;
  for (const Source &s : sources)
    for (const Piece &p : s.record->pieces) total += p.n;
  int half = std::max(3, int(std::lround(width_s / dt)));
  return std::max({1, half / 3, int((total + kRowsMax - 1) / kRowsMax)});
}

const std::vector<double> *temperature_of(const Piece &p) {
  auto it = p.signal.find("T_degC");
  return it == p.signal.end() ? nullptr : &it->second;
}

}  // namespace driveid::diagnose
