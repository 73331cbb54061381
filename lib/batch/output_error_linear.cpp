// SPDX-License-Identifier: Apache-2.0
// One linearisation: residuals scaled, filtered and freed of initial states.
#include "batch/output_error_inside.hpp"

#include <algorithm>
#include <cmath>

namespace driveid::batch {
namespace {

// Weight of a stacked value: i counts rows of output o inside a window.
double weight_of(const Fitting &f, std::size_t o, std::size_t i) { return f.scale[o] * (i < kHead ? f.head[o] : 1.0); }

void huber_weights(std::vector<Local> &local) {
  if (local.size() < 8) return;
  std::vector<double> rms;
  for (const Local &l : local) rms.push_back(std::sqrt(l.r.squaredNorm() / double(l.r.size())));
  std::vector<double> sorted = rms;
  std::nth_element(sorted.begin(), sorted.begin() + std::ptrdiff_t(sorted.size() / 2), sorted.end());
  const double limit = 4.0 * sorted[sorted.size() / 2];
  for (std::size_t k = 0; k < local.size(); k++) local[k].weight = limit > 0 && rms[k] > limit ? limit / rms[k] : 1.0;
}

// ridge: a state that the window does not show (the speed of an axis that sticks) stays where it is
Eigen::MatrixXd gain_of_states(const Eigen::MatrixXd &Js) {
  const Eigen::VectorXd size = Js.colwise().norm().transpose().cwiseMax(1e-300);
  const Eigen::MatrixXd unit = Js * size.cwiseInverse().asDiagonal();
  Eigen::MatrixXd gram = unit.transpose() * unit;
  gram.diagonal().array() += 1e-9;
  return size.cwiseInverse().asDiagonal() * gram.ldlt().solve(unit.transpose());
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

}  // namespace

void prepare_rows(const Fitting &f, std::size_t o, double *x, std::size_t n) {
  for (std::size_t i = 0; i < n; i++) x[i] *= weight_of(f, o, i);
  f.filter[o].apply(x, n);
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

namespace {

// What is known beforehand weighs as much as so many rows of this residual would.
void add_priors(const Fitting &f, Point point, Linear &lin) {
  lin.prior = Eigen::VectorXd::Zero(lin.A.rows());
  double squares = 0, rows = 0;
  for (const Local &l : lin.local) squares += l.weight * l.r.squaredNorm(), rows += l.weight * double(l.r.size());
  for (std::size_t k = 0; k < f.free.size(); k++) {
    if (!(f.free[k].prior > 0) || !(rows > 0)) continue;
    const Eigen::Index i = Eigen::Index(k);
    lin.prior[i] = squares / rows / (f.free[k].prior * f.free[k].prior);
    lin.A(i, i) += lin.prior[i];
    lin.b[i] -= lin.prior[i] * value_at(point, f.free[k]);
  }
}

}  // namespace

double prior_cost(const Fitting &f, const Linear &lin, const Point &point) {
  Point copy = point;
  double sum = 0;
  for (std::size_t k = 0; k < f.free.size(); k++) sum += lin.prior[Eigen::Index(k)] * std::pow(value_at(copy, f.free[k]), 2);
  return sum;
}

bool linearise(Fitting &f, const Point &point, const Stack &base, Linear &lin, bool weights, bool filters) {
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
  add_priors(f, point, lin);
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

}  // namespace driveid::batch
