// SPDX-License-Identifier: Apache-2.0
#include "batch/output_error.hpp"

#include "batch/noise.hpp"

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

namespace {

constexpr double kNeverPinned = 1e9;
constexpr int kPlain = 3, kFilters = 3;          // iterations before the first filter; those that choose one
constexpr double kConverged = 0.05;                // steps of so many standard deviations end the iteration
constexpr double kPartOfScale = 0.3;            // of FreeParam::scale, least step of the agreement
constexpr int kSkew = -2;                       // FreeParam::effect of the nuisance skew

struct Point {                                  // what is moved
  driveid_model model;
  double skew_s = 0;
};

double &value_at(Point &point, const FreeParam &free) { return free.effect == kSkew ? point.skew_s : value_of(point.model, free); }

struct Window {
  std::size_t stretch, from, to, at;            // at: first row in the stacked outputs
  double x[DRIVEID_X_COUNT];
  double memory[DRIVEID_MODEL_EFFECTS_MAX][DRIVEID_EFFECT_MEMORY];
};

struct Fitting {
  const OutputErrorProblem &problem;
  std::vector<FreeParam> free;                  // the problem's, and the skew
  std::vector<double> step;                     // difference step of each free parameter
  std::vector<Window> windows;
  std::size_t rows = 0;
  std::vector<double> measured, scale;          // stacked: window, output, row; 1/noise by output
  std::vector<double> head;                     // by output: factor on the first rows of a whole stretch
  std::vector<NoiseFilter> filter;              // by output
  std::vector<uint32_t> states;                 // indices of free initial states
  double state_step[DRIVEID_X_COUNT] = {};
};

using Stack = std::vector<double>;

// One pass over all windows with a model. moved: index into states of the initial state that is shifted by its step, or -1.
bool simulate(const Fitting &f, const Point &point, int moved, std::vector<Window> *remember, Stack &out) {
  out.resize(f.rows * f.problem.outputs.size());
  driveid_sim sim;
  driveid_sim_state state = {};
  std::size_t current = SIZE_MAX;
  std::size_t index = 0;
  for (const Window &w : f.windows) {
    if (w.stretch != current) {
      const Stretch &stretch = *f.problem.stretches[w.stretch];
      const driveid_sim_record view = stretch.view();
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

// Weight of a stacked value: i counts rows of output o inside a window.
double weight_of(const Fitting &f, std::size_t o, std::size_t i) { return f.scale[o] * (i < kHead ? f.head[o] : 1.0); }

struct Local {                       // one window, initial states projected out
  Eigen::MatrixXd Jp, Js;            // scaled, projected Jp; raw Js factors kept for the state step
  Eigen::VectorXd r;                 // projected
  Eigen::MatrixXd state_gain;        // maps raw scaled residual to the state step
  Eigen::VectorXd raw;
  Eigen::MatrixXd rawJp;
  double weight = 1;
};

struct Linear {
  std::vector<Stack> columns;        // differences by parameter, then by state
  std::vector<Local> local;
  Eigen::MatrixXd A;
  Eigen::VectorXd b;
  double cost = 0;
};

void huber_weights(std::vector<Local> &local) {
  if (local.size() < 8) return;
  std::vector<double> rms;
  for (const Local &l : local) rms.push_back(std::sqrt(l.r.squaredNorm() / double(l.r.size())));
  std::vector<double> sorted = rms;
  std::nth_element(sorted.begin(), sorted.begin() + std::ptrdiff_t(sorted.size() / 2), sorted.end());
  const double limit = 4.0 * sorted[sorted.size() / 2];
  for (std::size_t k = 0; k < local.size(); k++) local[k].weight = limit > 0 && rms[k] > limit ? limit / rms[k] : 1.0;
}

// All simulations of one linearisation; parameter columns are shared out between two threads. Backwards: parameters are moved to the
// other side, and the columns of the states stay as they are.
bool columns(const Fitting &f, const Point &point, const Stack &base, std::vector<Stack> &out, bool backwards = false) {
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

// Window w, output o: raw values (measured less base, or a column) scaled and filtered.
void prepare_rows(const Fitting &f, std::size_t o, double *x, std::size_t n) {
  for (std::size_t i = 0; i < n; i++) x[i] *= weight_of(f, o, i);
  f.filter[o].apply(x, n);
}

// ridge: a state that the window does not show (the speed of an axis that sticks) stays where it is
Eigen::MatrixXd gain_of_states(const Eigen::MatrixXd &Js) {
  const Eigen::VectorXd size = Js.colwise().norm().transpose().cwiseMax(1e-300);
  const Eigen::MatrixXd unit = Js * size.cwiseInverse().asDiagonal();
  Eigen::MatrixXd gram = unit.transpose() * unit;
  gram.diagonal().array() += 1e-9;
  return size.cwiseInverse().asDiagonal() * gram.ldlt().solve(unit.transpose());
}

Local localise(const Fitting &f, std::size_t w, const Stack &base, const std::vector<Stack> &d) {
  const std::size_t P = f.free.size(), S = f.states.size(), m = f.problem.outputs.size();
  const Window &window = f.windows[w];
  const std::size_t n = window.to - window.from, first = window.at * m;
  Local l;
  l.raw.resize(Eigen::Index(n * m));
  l.rawJp.resize(Eigen::Index(n * m), Eigen::Index(P));
  Eigen::MatrixXd Js(Eigen::Index(n * m), Eigen::Index(S));
  for (std::size_t i = 0; i < n * m; i++) l.raw[Eigen::Index(i)] = f.measured[first + i] - base[first + i];
  for (std::size_t k = 0; k < P; k++) std::copy_n(d[k].data() + first, n * m, l.rawJp.col(Eigen::Index(k)).data());
  for (std::size_t k = 0; k < S; k++) std::copy_n(d[P + k].data() + first, n * m, Js.col(Eigen::Index(k)).data());
  for (std::size_t o = 0; o < m; o++) {
    prepare_rows(f, o, l.raw.data() + o * n, n);
    for (std::size_t k = 0; k < P; k++) prepare_rows(f, o, l.rawJp.col(Eigen::Index(k)).data() + o * n, n);
    for (std::size_t k = 0; k < S; k++) prepare_rows(f, o, Js.col(Eigen::Index(k)).data() + o * n, n);
  }
  l.state_gain = gain_of_states(Js);
  l.r = l.raw - Js * (l.state_gain * l.raw);
  l.Jp = l.rawJp - Js * (l.state_gain * l.rawJp);
  return l;
}

// Noise filters from the residual as it is, initial states projected out anew under each filter.
void find_filters(Fitting &f, const Stack &base, const std::vector<Stack> &d) {
  const std::size_t S = f.states.size(), P = f.free.size(), m = f.problem.outputs.size();
  for (std::size_t o = 0; o < m; o++) {
    const driveid_signal signal = f.problem.outputs[o];
    const bool position = signal == DRIVEID_SIGNAL_THETA_RAD || signal == DRIVEID_SIGNAL_X_M || signal == DRIVEID_SIGNAL_THETA_L_RAD;
    std::vector<std::vector<double>> pieces(f.windows.size());
    auto filtered = [&](const NoiseFilter &filter) {
      double power = 0;
      std::vector<double> each;
      for (std::size_t w = 0; w < f.windows.size(); w++) {
        const std::size_t n = f.windows[w].to - f.windows[w].from, first = f.windows[w].at * m + o * n;
        Eigen::VectorXd r(static_cast<Eigen::Index>(n));
        Eigen::MatrixXd Js{Eigen::Index(n), Eigen::Index(S)};
        for (std::size_t i = 0; i < n; i++) r[Eigen::Index(i)] = f.measured[first + i] - base[first + i];
        filter.apply(r.data(), n);
        for (std::size_t k = 0; k < S; k++) {
          std::copy_n(d[P + k].data() + first, n, Js.col(Eigen::Index(k)).data());
          filter.apply(Js.col(Eigen::Index(k)).data(), n);
        }
        r -= Js * (gain_of_states(Js) * r);
        pieces[w].assign(r.data(), r.data() + n);
        each.push_back(r.squaredNorm() / double(n));
        power += each.back() * double(n);
      }
      if (each.size() < 8) return power;
      std::nth_element(each.begin(), each.begin() + std::ptrdiff_t(each.size() / 2), each.end());   // windows that went astray do not choose the filter
      double kept = 0;
      for (const auto &p : pieces) {
        double own = 0;
        for (double v : p) own += v * v;
        kept += std::min(own, 16 * each[each.size() / 2] * double(p.size()));
      }
      return kept;
    };
    NoiseFilter filter = fit_memory(position ? 2 : 1, filtered);
    filtered(filter);
    filter.ar = fit_short_memory(pieces, 4);
    f.filter[o] = filter;
    const double power = filtered(filter) / double(f.rows);
    if (m > 1 && power > 0) f.scale[o] = 1 / std::sqrt(power);
  }
}

bool linearise(Fitting &f, const Point &point, const Stack &base, Linear &lin, bool weights, bool filters = false) {
  const std::size_t P = f.free.size();
  std::vector<Stack> &d = lin.columns;
  if (!columns(f, point, base, d)) return false;
  if (filters) find_filters(f, base, d);
  std::vector<double> previous;
  for (const Local &l : lin.local) previous.push_back(l.weight);
  lin.local.clear();
  for (std::size_t w = 0; w < f.windows.size(); w++) {
    lin.local.push_back(localise(f, w, base, d));
    if (!weights && w < previous.size()) lin.local[w].weight = previous[w];
  }
  if (weights) huber_weights(lin.local);
  lin.A = Eigen::MatrixXd::Zero(Eigen::Index(P), Eigen::Index(P));
  lin.b = Eigen::VectorXd::Zero(Eigen::Index(P));
  for (const Local &l : lin.local) {
    lin.A += l.weight * l.Jp.transpose() * l.Jp;
    lin.b += l.weight * l.Jp.transpose() * l.r;
  }
  return true;
}

double total_cost(const Fitting &f, const Stack &base, const std::vector<double> &weight) {
  const std::size_t m = f.problem.outputs.size();
  double sum = 0;
  std::vector<double> e;
  for (std::size_t w = 0; w < f.windows.size(); w++) {
    const std::size_t n = f.windows[w].to - f.windows[w].from;
    double one = 0;
    for (std::size_t o = 0; o < m; o++) {
      const std::size_t first = f.windows[w].at * m + o * n;
      e.resize(n);
      for (std::size_t i = 0; i < n; i++) e[i] = f.measured[first + i] - base[first + i];
      prepare_rows(f, o, e.data(), n);
      for (double v : e) one += v * v;
    }
    sum += (w < weight.size() ? weight[w] : 1.0) * one;
  }
  return sum;
}

void weigh_outputs(Fitting &f, const Stack &base) {
  const std::size_t m = f.problem.outputs.size();
  for (std::size_t o = 0; o < m; o++) {
    double sum = 0, noise = 0;
    for (const Window &w : f.windows)
      for (std::size_t i = 0; i < w.to - w.from; i++) sum += std::pow(f.measured[w.at * m + o * (w.to - w.from) + i] - base[w.at * m + o * (w.to - w.from) + i], 2);
    for (const Stretch *s : f.problem.stretches) noise = std::max(noise, s->noise[f.problem.outputs[o]]);
    const double rms = std::sqrt(sum / double(f.rows));
    if (m > 1) f.scale[o] = rms > 0 ? 1 / rms : 1.0;
    const bool pinned = !f.problem.whiten && f.problem.window_s < kNeverPinned && f.rows / f.windows.size() >= 5 * kHead;
    f.head[o] = pinned && noise > 0 ? std::clamp(rms / noise, 1.0, 1e4) : 1.0;
  }
}

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

Eigen::MatrixXd pseudo_inverse(const Eigen::MatrixXd &A) {
  const Eigen::VectorXd size = A.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  Eigen::MatrixXd unit = size.asDiagonal() * A * size.asDiagonal();
  unit.diagonal().array() += 1e-12;
  return size.asDiagonal() * unit.ldlt().solve(Eigen::MatrixXd::Identity(A.rows(), A.cols())) * size.asDiagonal();
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
    if (f.free[k].effect == kSkew) continue;
    const double size = std::fabs(value_at(copy, f.free[k])), wanted = 0.2 * std::sqrt(std::max(0.0, spread(Eigen::Index(k), Eigen::Index(k))));
    if (wanted > 0 && std::isfinite(wanted)) f.step[k] = size > 0 ? std::clamp(wanted, 1e-7 * size, 1e-2 * size) : wanted;
  }
}

constexpr std::size_t kLags = 4;
constexpr std::size_t kClusters = 40;           // so many windows are blocks enough

// Sums of the projected score over blocks: whole windows where there are many, else parts of about 1/40 of the data each.
std::vector<Eigen::VectorXd> scores(const Fitting &f, const Linear &lin) {
  const Eigen::Index P = lin.A.rows();
  std::vector<Eigen::VectorXd> score;
  const std::size_t m = f.problem.outputs.size(), block = f.windows.size() >= kClusters ? f.rows : std::max<std::size_t>(20, f.rows / 40);
  std::size_t filled = 0;
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(P);
  auto close = [&] {
    if (filled) score.push_back(sum);
    sum.setZero();
    filled = 0;
  };
  for (std::size_t w = 0; w < lin.local.size(); w++) {
    const Local &l = lin.local[w];
    const std::size_t n = f.windows[w].to - f.windows[w].from;
    for (std::size_t from = 0; from < n;) {
      const std::size_t take = std::min(n - from, block - filled);
      for (std::size_t o = 0; o < m; o++)
        sum += l.weight * l.Jp.middleRows(Eigen::Index(o * n + from), Eigen::Index(take)).transpose() * l.r.segment(Eigen::Index(o * n + from), Eigen::Index(take));
      from += take;
      filled += take;
      if (filled == block) close();
    }
    if (f.windows.size() >= kClusters) close();
  }
  close();
  return score;
}

// How alike a step up and a step down are, by parameter: 1 where the differences are derivatives; towards 0 where the simulation sticks and slips at the
// bidding of a noisy input, so that a step only moves it to another chance, and the information in the differences is as imaginary. Steps are at
// least a part of what was not known at the start: between two chances everything is smooth.
Eigen::VectorXd agreement(const Fitting &fitted, const Point &point, const Stack &base, const Linear &lin) {
  const Eigen::Index P = lin.A.rows();
  Fitting f = fitted;
  for (std::size_t k = 0; k < f.free.size(); k++) f.step[k] = std::max(f.step[k], kPartOfScale * f.free[k].scale);
  std::vector<Stack> up = lin.columns, down = lin.columns;
  if (!columns(f, point, base, up) || !columns(f, point, base, down, true)) return Eigen::VectorXd::Zero(P);
  Eigen::VectorXd both = Eigen::VectorXd::Zero(P), ups = both, downs = both, alike = Eigen::VectorXd::Ones(P);
  for (std::size_t w = 0; w < f.windows.size(); w++) {
    const Local u = localise(f, w, base, up), d = localise(f, w, base, down);
    const double weight = lin.local[w].weight;
    both += weight * u.Jp.cwiseProduct(d.Jp).colwise().sum().transpose();
    ups += weight * u.Jp.colwise().squaredNorm().transpose();
    downs += weight * d.Jp.colwise().squaredNorm().transpose();
  }
  for (Eigen::Index k = 0; k < P; k++)
    if (ups[k] > 0 && downs[k] > 0) alike[k] = std::clamp(both[k] / std::sqrt(ups[k] * downs[k]), 0.0, 1.0);
  return alike;
}

// Sandwich of block scores, products with neighbours under Bartlett's weights; never below what white residuals of this size would give.
void covariance(const Fitting &f, const Linear &lin, const Eigen::VectorXd &alike, OutputErrorResult &result) {
  const Eigen::Index P = lin.A.rows();
  const std::vector<Eigen::VectorXd> score = scores(f, lin);
  const std::size_t m = f.problem.outputs.size();
  Eigen::MatrixXd meat = Eigen::MatrixXd::Zero(P, P);
  for (std::size_t k = 0; k < score.size(); k++) {
    meat += score[k] * score[k].transpose();
    for (std::size_t lag = 1; lag <= kLags && lag <= k; lag++)
      meat += (1.0 - double(lag) / double(kLags + 1)) * (score[k] * score[k - lag].transpose() + score[k - lag] * score[k].transpose());
  }
  double squares = 0;
  for (const Local &l : lin.local) squares += l.weight * l.r.squaredNorm();
  // parameters, and initial states inside windows that several blocks share, have taken part of the scores
  const double blocks = double(score.size()), states = f.windows.size() >= kClusters ? 0 : double(f.states.size() * f.windows.size());
  meat *= blocks / std::max(0.25 * blocks, blocks - double(P) - states);
  const Eigen::MatrixXd bread = pseudo_inverse(lin.A);
  Eigen::MatrixXd cov = bread * meat * bread;
  const double freedom = double(f.rows * m) - double(P) - double(f.states.size() * f.windows.size());
  const Eigen::MatrixXd white = squares / std::max(1.0, freedom) * bread;
  for (Eigen::Index k = 0; k < P; k++)
    if (cov(k, k) < white(k, k)) {
      const double grow = std::sqrt(white(k, k) / std::max(cov(k, k), 1e-300));
      cov.row(k) *= grow;
      cov.col(k) *= grow;
    }
  const Eigen::VectorXd grow = alike.cwiseMax(1e-6).cwiseSqrt().cwiseInverse();   // information that is not there
  cov = grow.asDiagonal() * cov * grow.asDiagonal();
  result.covariance = cov;
  // 97.5 % point of an estimate divided by a deviation from few neighbouring blocks (Kiefer and Vogelsang 2005, Bartlett's weights)
  const double b = std::min(0.5, double(kLags + 1) / std::max(1.0, blocks));
  result.quantile = 1.96 + 2.9694 * b + 0.4160 * b * b - 0.5324 * b * b * b;
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

}  // namespace

OutputErrorResult fit_output_error(const OutputErrorProblem &problem) {
  OutputErrorResult result;
  result.model = problem.model;
  Fitting f{problem, problem.free, {}, {}, 0, {}, {}, {}, {}, {}, {}};
  if (problem.free_skew && !problem.stretches.empty()) {
    const double dt = sample_time(*problem.stretches[0]);
    f.free.push_back({kSkew, 0, 0.02 * dt, -0.6 * dt, 0.6 * dt});
  }
  for (const FreeParam &p : f.free) f.step.push_back(p.scale);
  make_windows(f);
  if (f.windows.empty() || problem.outputs.empty()) return result;
  stack_measured(f);
  Point point{problem.model, 0};
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
    const double before = total_cost(f, base, weight);
    if (fresh) adapt_steps(f, point, lin, before);
    Eigen::MatrixXd A = lin.A;
    A.diagonal() += lambda * lin.A.diagonal() + Eigen::VectorXd::Constant(A.rows(), 1e-300);
    const Eigen::VectorXd step = pseudo_inverse(A) * lin.b;
    Point trial = point;
    const std::vector<Window> kept = f.windows;
    move(f, lin, step, trial, f.windows);
    Stack next;
    const bool runs = simulate(f, trial, -1, &f.windows, next);
    const double after = runs ? total_cost(f, next, weight) : INFINITY;
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
  Point point{model, 0};
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
