// SPDX-License-Identifier: Apache-2.0
#include "diagnose/equation.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace driveid::diagnose {

Kernel make_kernel(int half, double dt) {
  Kernel k;
  k.half = half;
  const int n = 2 * half + 1;
  const double h = half + 1.0;
  for (auto &w : k.w) w.assign(std::size_t(n), 0.0);
  for (int i = 0; i < n; ++i) {
    double u = (i - half) / h, q = 1 - u * u;
    k.w[0][std::size_t(i)] = q * q * q * q;
    k.w[1][std::size_t(i)] = 8 * u * q * q * q;                        // of x(t + u): integrate by parts
    k.w[2][std::size_t(i)] = -8 * q * q * q + 48 * u * u * q * q;
  }
  double s0 = 0, s1 = 0, m0 = 0, m2 = 0;
  for (int i = 0; i < n; ++i) {
    double x = i - half;
    s0 += k.w[0][std::size_t(i)];
    s1 += k.w[1][std::size_t(i)] * x;
    m0 += k.w[2][std::size_t(i)];
  }
  for (int i = 0; i < n; ++i) {   // second-derivative kernel: no response to a constant, exact on a parabola
    k.w[2][std::size_t(i)] -= m0 / s0 * k.w[0][std::size_t(i)];
    double x = i - half;
    m2 += k.w[2][std::size_t(i)] * x * x;
  }
  for (int i = 0; i < n; ++i) {
    k.w[0][std::size_t(i)] /= s0;
    k.w[1][std::size_t(i)] /= s1 * dt;
    k.w[2][std::size_t(i)] *= 2 / (m2 * dt * dt);
  }
  return k;
}

void apply_kernel(const Track &track, const std::vector<double> &x, int derivative, double *out) {
  const Kernel &k = track.kernel;
  const double *w = k.w[derivative].data();
  const int n = 2 * k.half + 1;
  for (std::size_t r = 0; r < track.row.size(); ++r) {
    const double *p = x.data() + track.row[r] - k.half;
    const double centre = derivative ? x[std::size_t(track.row[r])] : 0.0;
    double sum = 0;
    for (int i = 0; i < n; ++i) sum += w[i] * (p[i] - centre);
    out[r] = sum;
  }
}

Eigen::VectorXd stack(const Equation &equation, const FineSignal &signal, int derivative) {
  Eigen::VectorXd out(Eigen::Index(equation.rows));
  std::vector<double> fine;
  for (const Track &t : equation.tracks) {
    signal(t, fine);
    apply_kernel(t, fine, derivative, out.data() + t.first);
  }
  return out;
}

double remove_drive(const Equation &equation, Eigen::Ref<Eigen::VectorXd> column) {
  double square = equation.drive.squaredNorm();
  if (!(square > 0)) return 0;
  double part = equation.drive.dot(column) / square;
  column -= part * equation.drive;
  return part;
}

// Functions of the smoothed current would let a fit choose how much of the current's noise it passes: their linear part is
// that of the current as logged, which the resistance reads too.
void same_current(const Equation &equation, Eigen::Ref<Eigen::MatrixXd> columns) {
  if (equation.current.size() == 0 || equation.current.size() != columns.rows()) return;
  const double square = equation.current_smooth.squaredNorm();
  if (!(square > 0)) return;
  for (Eigen::Index k = 0; k < columns.cols(); ++k) columns.col(k) += equation.current_smooth.dot(columns.col(k)) / square * (equation.current - equation.current_smooth);
}

Eigen::MatrixXd effect_columns(const Equation &equation, const driveid_effect_info &info, const double *shape) {
  Eigen::MatrixXd out(Eigen::Index(equation.rows), info.columns);
  std::vector<double> fine[DRIVEID_EFFECT_COLUMNS_MAX];
  for (const Track &t : equation.tracks) {
    for (int c = 0; c < info.columns; ++c) fine[c].resize(t.state.size());
    double memory[DRIVEID_EFFECT_MEMORY] = {0, 0, 0, 0}, column[DRIVEID_EFFECT_COLUMNS_MAX] = {0, 0, 0, 0};
    for (std::size_t k = 0; k < t.state.size(); ++k) {
      info.fill(shape, &t.state[k], memory, column);
      for (int c = 0; c < info.columns; ++c) fine[c][k] = std::isfinite(column[c]) ? column[c] : 0.0;
    }
    for (int c = 0; c < info.columns; ++c) apply_kernel(t, fine[c], 0, out.col(c).data() + t.first);
  }
  same_current(equation, out);
  return out;
}

Eigen::VectorXd whiten(const Equation &equation, const Eigen::VectorXd &raw) {
  const int p = int(equation.ar.size());
  if (p == 0) return raw;
  const bool masked = !equation.mask.empty();
  Eigen::VectorXd out = Eigen::VectorXd::Zero(raw.size());
  for (const Track &t : equation.tracks) {
    int age = 0, run = -1;
    for (std::size_t r = 0; r < t.row.size(); ++r) {
      age = t.run[r] == run ? age + 1 : 0;
      run = t.run[r];
      if (masked && equation.mask[t.first + r]) age = -1;
      if (age < p) continue;
      const double *e = raw.data() + t.first + r;
      double v = e[0];
      for (int j = 1; j <= p; ++j) v -= equation.ar[std::size_t(j - 1)] * e[-j];
      out[Eigen::Index(t.first + r)] = v * equation.weight[t.first + r];
    }
  }
  return out;
}

Eigen::MatrixXd whiten(const Equation &equation, const Eigen::MatrixXd &raw) {
  Eigen::MatrixXd out(raw.rows(), raw.cols());
  for (Eigen::Index c = 0; c < raw.cols(); ++c) out.col(c) = whiten(equation, Eigen::VectorXd(raw.col(c)));
  return out;
}

void weigh_rows(Equation &equation) {
  equation.weight.assign(equation.rows, 1.0);
  const int p = int(equation.ar.size());
  const bool masked = !equation.mask.empty();
  for (const Track &t : equation.tracks) {
    int age = 0, run = -1;
    for (std::size_t r = 0; r < t.row.size(); ++r) {
      age = t.run[r] == run ? age + 1 : 0;
      run = t.run[r];
      if (masked && equation.mask[t.first + r]) age = -1;
      if (age < p) equation.weight[t.first + r] = 0;
    }
  }
}

// Rows where even a flexible model misses by far more than anywhere else: wrong samples that no rule of the record's preparation saw.
// Where they are many they belong to the drive, and stay.
void mask_outliers(Equation &equation, const Eigen::VectorXd &residual) {
  const Eigen::VectorXd white = whiten(equation, residual);
  std::vector<double> size;
  for (Eigen::Index k = 0; k < white.size(); ++k)
    if (white[k] != 0) size.push_back(std::fabs(white[k]));
  if (size.size() < 100) return;
  auto mid = size.begin() + std::ptrdiff_t(size.size() / 2);
  std::nth_element(size.begin(), mid, size.end());
  const double limit = 10 * 1.48 * *mid;
  std::vector<unsigned char> mask(equation.rows, 0);
  std::size_t many = 0;
  for (std::size_t k = 0; k < equation.rows; ++k) mask[k] = std::fabs(white[Eigen::Index(k)]) > limit, many += mask[k];
  if (many == 0 || many * 200 > equation.rows) return;
  equation.mask = mask;
}

void fit_whitening(Equation &equation, const Eigen::VectorXd &residual, int order) {
  std::vector<double> corr(std::size_t(order) + 1, 0.0);
  double clip = 0;
  {
    std::vector<double> magnitude(residual.data(), residual.data() + residual.size());
    for (double &m : magnitude) m = std::fabs(m);
    if (!magnitude.empty()) {
      auto mid = magnitude.begin() + std::ptrdiff_t(magnitude.size() / 2);
      std::nth_element(magnitude.begin(), mid, magnitude.end());
      clip = 6 * *mid;
    }
  }
  auto e = [&](std::size_t k) { return std::clamp(residual[Eigen::Index(k)], -clip, clip); };
  std::vector<double> count(std::size_t(order) + 1, 0.0);
  for (const Track &t : equation.tracks)
    for (std::size_t r = 0; r < t.row.size(); ++r)
      for (int j = 0; j <= order && std::size_t(j) <= r && t.run[r - std::size_t(j)] == t.run[r]; ++j)
        corr[std::size_t(j)] += e(t.first + r) * e(t.first + r - std::size_t(j)), count[std::size_t(j)] += 1;
  equation.ar.clear();
  if (count[0] > 20.0 * order && corr[0] > 0) {
    for (int j = 0; j <= order; ++j) corr[std::size_t(j)] /= std::max(1.0, count[std::size_t(j)]);
    corr[0] *= 1.01;   // some white noise keeps the inverse filter tame where the kernel passes little
    std::vector<double> a(std::size_t(order), 0.0), previous;   // Levinson-Durbin
    double error = corr[0];
    for (int k = 0; k < order; ++k) {
      double acc = corr[std::size_t(k + 1)];
      for (int j = 0; j < k; ++j) acc -= a[std::size_t(j)] * corr[std::size_t(k - j)];
      double reflection = acc / error;
      if (std::fabs(reflection) >= 0.9995) break;
      previous = a;
      a[std::size_t(k)] = reflection;
      for (int j = 0; j < k; ++j) a[std::size_t(j)] = previous[std::size_t(j)] - reflection * previous[std::size_t(k - 1 - j)];
      error *= 1 - reflection * reflection;
    }
    equation.ar = a;
  }
  weigh_rows(equation);
}

Eigen::VectorXd delayed_target(const Equation &equation, double delay_s) {
  Eigen::VectorXd out(Eigen::Index(equation.rows));
  std::vector<double> fine;
  for (const Track &t : equation.tracks) {
    const double shift = (delay_s + equation.input_shift_s) / t.dt_s;
    const std::size_t n = t.drive_raw.size();
    fine.resize(n);
    const double whole = std::floor(shift), part = shift - whole;
    for (std::size_t k = 0; k < n; ++k) {
      double at = double(k) - whole;
      auto value = [&](double index) {
        return t.drive_raw[std::size_t(std::clamp(index, 0.0, double(n - 1)))];
      };
      fine[k] = equation.gain * ((1 - part) * value(at) + part * value(at - 1));
    }
    apply_kernel(t, fine, 0, out.data() + t.first);
  }
  return out;
}

double rms_where(const Equation &e, const Eigen::VectorXd &r, bool held) {
  double s = 0, n = 0;
  for (std::size_t k = 0; k < e.rows; ++k)
    if ((e.block_held_out[std::size_t(e.block[k])] != 0) == held) s += r[Eigen::Index(k)] * r[Eigen::Index(k)], n += 1;
  return n > 0 ? std::sqrt(s / n) : 0;
}

}  // namespace driveid::diagnose
