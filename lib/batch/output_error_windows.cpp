// SPDX-License-Identifier: Apache-2.0
// Windows, their simulations, and the differences of these.
#include "batch/output_error_inside.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <thread>

namespace driveid::batch {

driveid_sim_record Stretch::view() const {
  driveid_sim_record r = {};
  r.rows = t_s.size();
  r.t_s = t_s.data();
  for (int s = 0; s < DRIVEID_SIGNAL_COUNT; s++) r.signal[s] = column[s].empty() ? nullptr : column[s].data();
  r.hold = hold;
  return r;
}

double &value_of(driveid_model &model, const FreeParam &free) {
  return free.effect < 0 ? model.param[free.index].value : model.effect[free.effect].param[free.index].value;
}

double &value_at(Point &point, const FreeParam &free) {
  return free.effect == kSkew ? point.skew_s : free.effect == kBlur ? point.blur : free.effect == kMotion ? point.motion : value_of(point.model, free);
}

namespace {

bool drives(driveid_sim_mode mode, int signal) {
  const bool voltage = signal == DRIVEID_SIGNAL_V_V || signal == DRIVEID_SIGNAL_V_D_V || signal == DRIVEID_SIGNAL_V_Q_V;
  const bool effort = signal == DRIVEID_SIGNAL_TAU_NM || signal == DRIVEID_SIGNAL_F_N || signal == DRIVEID_SIGNAL_I_A || signal == DRIVEID_SIGNAL_I_Q_A;
  return mode == DRIVEID_SIM_ELECTRICAL ? voltage : voltage || effort;
}

// The driving columns with a part of their second difference added: what their course between samples does to the motion, to second order.
void blur_inputs(driveid_sim_mode mode, double blur, const Stretch &stretch, std::vector<double> (&own)[DRIVEID_SIGNAL_COUNT], driveid_sim_record &view) {
  for (int s = 0; s < DRIVEID_SIGNAL_COUNT; s++) {
    const std::vector<double> &x = stretch.column[s];
    if (!drives(mode, s) || x.size() < 3) continue;
    own[s] = x;
    for (std::size_t k = 1; k + 1 < x.size(); k++) own[s][k] += blur * (x[k - 1] - 2 * x[k] + x[k + 1]);
    view.signal[s] = own[s].data();
  }
}

void move_speed(double samples, const Stretch &stretch, std::vector<double> (&own)[DRIVEID_SIGNAL_COUNT], driveid_sim_record &view) {
  for (int s : {DRIVEID_SIGNAL_OMEGA_RAD_S, DRIVEID_SIGNAL_V_M_S}) {
    const std::vector<double> &x = stretch.column[s];
    if (x.size() < 3) continue;
    own[s] = x;
    for (std::size_t k = 1; k + 1 < x.size(); k++) own[s][k] += 0.5 * samples * (x[k + 1] - x[k - 1]);
    view.signal[s] = own[s].data();
  }
}

}  // namespace

bool simulate(const Fitting &f, const Point &point, int moved, std::vector<Window> *remember, Stack &out) {
  out.resize(f.rows * f.problem.outputs.size());
  driveid_sim sim;
  driveid_sim_state state = {};
  std::size_t current = SIZE_MAX;
  std::vector<double> blurred[DRIVEID_SIGNAL_COUNT];
  std::size_t index = 0;
  for (const Window &w : f.windows) {
    if (w.stretch != current) {
      const Stretch &stretch = *f.problem.stretches[w.stretch];
      driveid_sim_record view = stretch.view();
      if (point.blur != 0) blur_inputs(f.problem.mode, point.blur, stretch, blurred, view);
      if (point.motion != 0) move_speed(point.motion, stretch, blurred, view);
      if (driveid_sim_init(&sim, &point.model, &view, f.problem.mode, nullptr, 0)) return false;
      sim.delay_s += stretch.skew_s + point.skew_s;
      std::memset(&state, 0, sizeof state);
      current = w.stretch;
    }
    if (remember) std::memcpy((*remember)[index].memory, state.memory, sizeof state.memory);
    if (moved >= 0) std::memcpy(state.memory, w.memory, sizeof state.memory);
    std::memcpy(state.x, w.x, sizeof state.x);
    if (moved >= 0) state.x[f.states[std::size_t(moved)]] += f.state_step[f.states[std::size_t(moved)]];
    state.direction = 0;
    state.accel = 0;
    double *to[DRIVEID_SIGNAL_COUNT] = {};
    const std::size_t n = w.to - w.from;
    for (std::size_t o = 0; o < f.problem.outputs.size(); o++) to[f.problem.outputs[o]] = out.data() + w.at * f.problem.outputs.size() + o * n;
    if (driveid_sim_run(&sim, w.from, w.to, &state, to)) return false;
    index++;
  }
  return true;
}

void make_windows(Fitting &f) {
  const OutputErrorProblem &p = f.problem;
  for (std::size_t s = 0; s < p.stretches.size(); s++) {
    const Stretch &stretch = *p.stretches[s];
    const std::size_t rows = stretch.t_s.size();
    const double dt = (stretch.t_s.back() - stretch.t_s.front()) / double(rows - 1);
    const std::size_t length = p.window_s > 0 ? std::max<std::size_t>(40, std::size_t(p.window_s / dt)) : rows;
    const std::size_t count = std::max<std::size_t>(1, rows / length);
    const driveid_sim_record view = stretch.view();
    driveid_sim sim;
    if (driveid_sim_init(&sim, &p.model, &view, p.mode, nullptr, 0)) return;
    if (f.states.empty()) {
      uint32_t index[DRIVEID_X_COUNT];
      const uint32_t n = driveid_sim_free_states(&sim, index);
      f.states.assign(index, index + n);
    }
    for (std::size_t k = 0; k < count; k++) {
      Window w = {};
      w.stretch = s;
      w.from = k * rows / count;
      w.to = (k + 1) * rows / count;
      w.at = f.rows;
      driveid_sim_state start;
      driveid_sim_start(&sim, w.from, &start);
      std::memcpy(w.x, start.x, sizeof w.x);
      f.rows += w.to - w.from;
      f.windows.push_back(w);
    }
  }
}

void stack_measured(Fitting &f) {
  const std::size_t m = f.problem.outputs.size();
  f.measured.resize(f.rows * m);
  f.scale.assign(m, 1.0);
  f.head.assign(m, 1.0);
  f.filter.assign(m, {});
  for (const Window &w : f.windows)
    for (std::size_t o = 0; o < m; o++) {
      const auto &column = f.problem.stretches[w.stretch]->column[f.problem.outputs[o]];
      std::copy(column.begin() + std::ptrdiff_t(w.from), column.begin() + std::ptrdiff_t(w.to), f.measured.begin() + std::ptrdiff_t(w.at * m + o * (w.to - w.from)));
    }
  // steps of the initial states: a thousandth of what the outputs do
  double lo = INFINITY, hi = -INFINITY, seconds = 0;
  for (double v : f.measured) lo = std::min(lo, v), hi = std::max(hi, v);
  for (const Stretch *s : f.problem.stretches) seconds = std::max(seconds, s->t_s.back() - s->t_s.front());
  const double size = hi > lo ? hi - lo : 1.0;
  for (int k = 0; k < DRIVEID_X_COUNT; k++) f.state_step[k] = 1e-4 * size * (k == DRIVEID_X_SPEED || k == DRIVEID_X_SPEED_L ? 1.0 / std::max(1e-3, std::min(1.0, seconds)) : 1.0);
}

bool columns(const Fitting &f, const Point &point, const Stack &base, std::vector<Stack> &out, bool backwards) {
  const std::size_t P = f.free.size(), S = f.states.size(), count = backwards ? P : P + S;
  out.resize(P + S);
  std::vector<unsigned char> good(count, 1);
  auto work = [&](std::size_t first) {
    for (std::size_t k = first; k < count; k += 2) {
      Point moved = point;
      double step = 1;
      if (k < P) {
        const FreeParam &free = f.free[k];
        step = f.step[k];
        double &value = value_at(moved, free);
        const double before = value;
        if ((value + step > free.hi) != backwards) step = -step;
        value = std::clamp(before + step, free.lo, free.hi);
        step = value - before;
        if (step == 0) {
          out[k].assign(base.size(), 0.0);
          continue;
        }
      } else {
        step = f.state_step[f.states[k - P]];
      }
      good[k] = simulate(f, moved, k < P ? -1 : int(k - P), nullptr, out[k]);
      for (std::size_t i = 0; good[k] && i < base.size(); i++) out[k][i] = (out[k][i] - base[i]) / step;
    }
  };
  std::thread other(work, 1);
  work(0);
  other.join();
  return std::all_of(good.begin(), good.end(), [](unsigned char g) { return g; });
}

}  // namespace driveid::batch
