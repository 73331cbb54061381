// SPDX-License-Identifier: Apache-2.0
#include "diagnose/fit_score.hpp"

#include <algorithm>
#include <cmath>

namespace driveid::diagnose {

double rms_error(const std::vector<double> &measured, const std::vector<double> &predicted, std::size_t skip) {
  double sum = 0;
  std::size_t n = 0;
  for (std::size_t k = skip; k < predicted.size() && k < measured.size(); k++)
    if (std::isfinite(predicted[k])) sum += std::pow(measured[k] - predicted[k], 2), n++;
  return n ? std::sqrt(sum / double(n)) : -1;
}

std::vector<double> predict_windows(const driveid_model &model, const batch::Stretch &stretch, driveid_sim_mode mode, driveid_signal signal, double window_s) {
  const std::size_t rows = stretch.t_s.size();
  const double dt = (stretch.t_s.back() - stretch.t_s.front()) / double(rows - 1);
  const std::size_t length = window_s > 0 ? std::clamp<std::size_t>(std::size_t(std::lround(window_s / dt)), 10, rows) : rows;
  const std::size_t settle = window_s > 0 ? std::min<std::size_t>(kSettle, std::max<std::size_t>(5, length / 5)) : kSettle;
  std::vector<double> all(rows, NAN);
  std::vector<driveid_signal> wanted{signal};
  for (std::size_t from = 0; from + 2 * settle <= rows; from += length) {
    const std::size_t to = std::min(rows, from + length);
    if (to - from < 2 * settle && from > 0) break;
    std::vector<double> out[DRIVEID_SIGNAL_COUNT];
    if (!batch::free_run(model, stretch, mode, from, to, settle, out, wanted)) {
      if (window_s == 0) return {};
      continue;
    }
    for (std::size_t k = settle; k < to - from; k++) all[from + k] = out[signal][k];
  }
  return all;
}

double score_windows(const driveid_model &model, const batch::Stretch &stretch, driveid_sim_mode mode, driveid_signal signal, double window_s) {
  if (stretch.column[signal].empty()) return -1;
  return rms_error(stretch.column[signal], predict_windows(model, stretch, mode, signal, window_s), 0);
}

std::vector<double> predict_one_step(const driveid_model &model, const batch::Stretch &stretch, driveid_sim_mode mode, driveid_signal signal) {
  const driveid_sim_record view = stretch.view();
  driveid_sim sim;
  std::vector<double> best;
  double least = INFINITY;
  const bool position = signal == DRIVEID_SIGNAL_THETA_RAD || signal == DRIVEID_SIGNAL_X_M;
  const int state_index = position ? DRIVEID_X_ANGLE : signal == DRIVEID_SIGNAL_OMEGA_RAD_S || signal == DRIVEID_SIGNAL_V_M_S ? DRIVEID_X_SPEED
                          : signal == DRIVEID_SIGNAL_I_D_A ? DRIVEID_X_CURRENT_D : signal == DRIVEID_SIGNAL_Y ? 0 : DRIVEID_X_CURRENT;
  if (driveid_sim_init(&sim, &model, &view, mode, nullptr, 0)) return best;
  sim.delay_s += stretch.skew_s;
  for (double gain : {0.1, 0.25, 0.5, 0.9}) {
    driveid_sim_state state;
    driveid_sim_start(&sim, 0, &state);
    const std::size_t rows = stretch.t_s.size();
    std::vector<double> predicted(rows, NAN);
    double two[2] = {0, 0};
    double *out[DRIVEID_SIGNAL_COUNT] = {};
    out[signal] = two;
    bool runs = true;
    for (std::size_t k = 0; runs && k + 1 < rows; k++) {
      runs = driveid_sim_run(&sim, k, k + 2, &state, out) == DRIVEID_OK;
      predicted[k + 1] = two[1];
      const double e = stretch.column[signal][k + 1] - two[1], dt = stretch.t_s[k + 1] - stretch.t_s[k];
      state.x[state_index] += gain * e;
      if (position) state.x[DRIVEID_X_SPEED] += gain * gain / (2 - gain) * e / dt;   // critically damped alpha-beta pair
    }
    const double rms = runs ? rms_error(stretch.column[signal], predicted, kSettle) : -1;
    if (rms >= 0 && rms < least) least = rms, best = std::move(predicted);
  }
  return best;
}

}  // namespace driveid::diagnose
