// SPDX-License-Identifier: Apache-2.0
#include "batch/output_error_inside.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace driveid::batch {
namespace {

constexpr int kPlain = 3, kFilters = 3;          // iterations before the first filter; those that choose one
constexpr double kTiming = 0.29;                   // samples: stamps of averages and of instants differ by up to a half either way
constexpr double kConverged = 0.05;                // steps of so many standard deviations end the iteration

// Moves parameters and initial states; false where a bound left no room.
void move(const Fitting &f, const Linear &lin, const Eigen::VectorXd &step, Point &point, std::vector<Window> &windows) {
  Eigen::VectorXd taken = step;
  for (std::size_t k = 0; k < f.free.size(); k++) {
    const FreeParam &free = f.free[k];
    double &value = value_at(point, free);
    const double before = value;
    value = std::clamp(value + step[Eigen::Index(k)], free.lo, free.hi);
    taken[Eigen::Index(k)] = value - before;
  }
  for (std::size_t w = 0; w < windows.size(); w++) {
    const Local &l = lin.local[w];
    const Eigen::VectorXd ds = l.state_gain * (l.raw - l.rawJp * taken);
    for (std::size_t k = 0; k < f.states.size(); k++) windows[w].x[f.states[k]] += ds[Eigen::Index(k)];
  }
}

std::vector<double> weights_of(const Linear &lin) {
  std::vector<double> w;
  for (const Local &l : lin.local) w.push_back(l.weight);
  return w;
}

// The longest step in standard deviations as they are now (white residuals assumed).
double length_of(const Fitting &f, const Linear &lin, const Eigen::VectorXd &step, double cost) {
  const Eigen::VectorXd variance = pseudo_inverse(lin.A).diagonal() * (cost / double(std::max<std::size_t>(1, f.rows)));
  double longest = 0;
  for (Eigen::Index k = 0; k < step.size(); k++) longest = std::max(longest, std::fabs(step[k]) / std::sqrt(std::max(1e-300, variance[k])));
  return longest;
}

// Difference steps of a fifth of each parameter's uncertainty as it is now: smaller ones see the kinks of sticking, larger ones another model.
void adapt_steps(Fitting &f, const Point &point, const Linear &lin, double cost) {
  const Eigen::MatrixXd spread = pseudo_inverse(lin.A) * (cost / double(std::max<std::size_t>(1, f.rows)));
  Point copy = point;
  for (std::size_t k = 0; k < f.step.size(); k++) {
    if (f.free[k].effect < -1) continue;
    const double size = std::fabs(value_at(copy, f.free[k])), wanted = 0.2 * std::sqrt(std::max(0.0, spread(Eigen::Index(k), Eigen::Index(k))));
    if (wanted > 0 && std::isfinite(wanted)) f.step[k] = size > 0 ? std::clamp(wanted, 1e-7 * size, 1e-2 * size) : wanted;
  }
}

void report_rmse(const Fitting &f, const Stack &base, OutputErrorResult &result) {
  const std::size_t m = f.problem.outputs.size();
  result.rmse = Eigen::VectorXd::Zero(Eigen::Index(m));
  for (const Window &w : f.windows)
    for (std::size_t o = 0; o < m; o++)
      for (std::size_t i = 0; i < w.to - w.from; i++) {
        const std::size_t at = w.at * m + o * (w.to - w.from) + i;
        result.rmse[Eigen::Index(o)] += std::pow(f.measured[at] - base[at], 2);
      }
  result.rmse = (result.rmse / double(f.rows)).cwiseSqrt();
}

double sample_time(const Stretch &s) { return (s.t_s.back() - s.t_s.front()) / double(s.t_s.size() - 1); }

// blur: bound of the input's course between samples, 0: straight lines. At the bound is set where it was reached.
OutputErrorResult fit_with(const OutputErrorProblem &problem, double blur, bool &at_bound) {
  OutputErrorResult result;
  result.model = problem.model;
  Fitting f{problem, problem.free, {}, {}, 0, {}, {}, {}, {}, {}, {}};
  if (problem.free_skew && !problem.stretches.empty()) {
    const double dt = sample_time(*problem.stretches[0]);
    const double known = problem.free_motion ? kTiming : 0;
    f.free.push_back({kSkew, 0, 0.02 * dt, -problem.most_skew * dt, problem.most_skew * dt, known * dt});
    if (problem.free_motion) f.free.push_back({kMotion, 0, 0.02, -problem.most_skew, problem.most_skew, known});
    else if (blur > 0) f.free.push_back({kBlur, 0, 0.01, -blur, blur});
  }
  for (const FreeParam &p : f.free) f.step.push_back(p.scale);
  make_windows(f);
  if (f.windows.empty() || problem.outputs.empty()) return result;
  stack_measured(f);
  Point point{problem.model};
  Stack base;
  if (!simulate(f, point, -1, &f.windows, base)) return result;
  Linear lin;
  double lambda = 1e-4;
  bool fresh = true;
  for (int it = 0, plain = problem.whiten ? kPlain : 0; it < plain + problem.iterations; it++) {
    if (problem.cancelled && problem.cancelled()) return result;
    const bool whitening = problem.whiten && it >= plain && it < plain + kFilters;
    if (it < 2) weigh_outputs(f, base);
    if ((fresh || whitening) && !linearise(f, point, base, lin, it < 3 || whitening, whitening)) return result;
    const std::vector<double> weight = weights_of(lin);
    const double before = total_cost(f, base, weight) + prior_cost(f, lin, point);
    if (fresh) adapt_steps(f, point, lin, before);
    Eigen::MatrixXd A = lin.A;
    A.diagonal() += lambda * lin.A.diagonal() + Eigen::VectorXd::Constant(A.rows(), 1e-300);
    const Eigen::VectorXd step = pseudo_inverse(A) * lin.b;
    Point trial = point;
    const std::vector<Window> kept = f.windows;
    move(f, lin, step, trial, f.windows);
    Stack next;
    const bool runs = simulate(f, trial, -1, &f.windows, next);
    const double after = runs ? total_cost(f, next, weight) + prior_cost(f, lin, trial) : INFINITY;
    if (std::isfinite(after) && after <= before) {
      point = trial;
      base = std::move(next);
      lambda = std::max(1e-9, lambda / 10);
      fresh = true;
      if (it >= 2 + plain && before - after < 1e-3 * before && length_of(f, lin, step, before) < kConverged) break;
    } else {
      f.windows = kept;
      lambda *= 30;
      fresh = false;
      if (lambda > 1e8) break;
    }
  }
  if (!linearise(f, point, base, lin, false)) return result;
  result.model = point.model;
  result.skew_s = point.skew_s;
  at_bound = blur > 0 && std::fabs(point.blur) > 0.95 * blur;
  const Eigen::VectorXd alike = agreement(f, point, base, lin);
  covariance(f, lin, alike, result);
  report_rmse(f, base, result);
  result.cost = total_cost(f, base, weights_of(lin));
  const Eigen::Index P = Eigen::Index(problem.free.size());
  result.covariance = Eigen::MatrixXd(result.covariance.topLeftCorner(P, P));
  result.agreement = P ? alike.head(P).minCoeff() : 1.0;
  result.ok = result.covariance.allFinite();
  return result;
}

}  // namespace

// What lies between samples is bounded; beyond, the input's second difference stands in for something else (a spring, a filter), and is left alone.
OutputErrorResult fit_output_error(const OutputErrorProblem &problem) {
  bool at_bound = false;
  const OutputErrorResult result = fit_with(problem, problem.free_skew && !problem.free_motion ? problem.most_blur : 0, at_bound);
  return at_bound ? fit_with(problem, 0, at_bound) : result;
}

bool free_run(const driveid_model &model, const Stretch &stretch, driveid_sim_mode mode, std::size_t from, std::size_t to, std::size_t settle,
              std::vector<double> (&out)[DRIVEID_SIGNAL_COUNT], const std::vector<driveid_signal> &wanted) {
  // initial state: least squares of the model over the first rows, parameters fixed
  OutputErrorProblem start;
  start.model = model;
  start.mode = mode;
  for (driveid_signal s : wanted)
    if (!stretch.column[s].empty()) start.outputs.push_back(s);
  Stretch head;
  const std::size_t end = std::min(to, from + std::max<std::size_t>(settle, 4));
  head.t_s.assign(stretch.t_s.begin() + std::ptrdiff_t(from), stretch.t_s.begin() + std::ptrdiff_t(end));
  for (int s = 0; s < DRIVEID_SIGNAL_COUNT; s++)
    if (!stretch.column[s].empty()) head.column[s].assign(stretch.column[s].begin() + std::ptrdiff_t(from), stretch.column[s].begin() + std::ptrdiff_t(end));
  head.hold = stretch.hold;
  head.skew_s = stretch.skew_s;
  start.window_s = kNeverPinned;   // one window, all its rows count alike
  start.stretches = {&head};
  const driveid_sim_record view = stretch.view();
  driveid_sim sim;
  driveid_sim_state state;
  if (driveid_sim_init(&sim, &model, &view, mode, nullptr, 0) || driveid_sim_start(&sim, from, &state)) return false;
  sim.delay_s += stretch.skew_s;
  Fitting f{start, {}, {}, {}, 0, {}, {}, {}, {}, {}, {}};
  Point point{model};
  make_windows(f);
  if (!f.windows.empty() && !start.outputs.empty()) {
    stack_measured(f);
    Stack base;
    Linear lin;
    for (int it = 0; it < 3; it++) {
      if (!simulate(f, point, -1, &f.windows, base)) break;
      weigh_outputs(f, base);
      if (!linearise(f, point, base, lin, false)) break;
      const double before = total_cost(f, base, {});
      const std::vector<Window> kept = f.windows;
      move(f, lin, Eigen::VectorXd(), point, f.windows);
      if (!simulate(f, point, -1, nullptr, base) || !(total_cost(f, base, {}) <= before)) {
        f.windows = kept;
        break;
      }
    }
    std::memcpy(state.x, f.windows[0].x, sizeof state.x);
  }
  double *target[DRIVEID_SIGNAL_COUNT] = {};
  for (driveid_signal s : wanted) {
    out[s].assign(to - from, 0.0);
    target[s] = out[s].data();
  }
  return driveid_sim_run(&sim, from, to, &state, target) == DRIVEID_OK;
}

}  // namespace driveid::batch
