// SPDX-License-Identifier: Apache-2.0
#include "diagnose/floor.hpp"

#include <algorithm>
#include <cmath>

namespace driveid::diagnose {
namespace {

constexpr int kArOrder = 6;

// Which part of the noise comes through the motion (white noise of the position or speed, shaped by inertia and damping) and which
// through the drive? Two non-negative variances that reproduce the residual's autocorrelation.
void split_noise(Equation &e, const Eigen::VectorXd &residual, const Eigen::VectorXd &p) {
  e.noise_motion = e.noise_drive = 0;
  if (e.electrical || e.tracks.empty()) return;
  const Track &t0 = e.tracks[0];
  const int step = t0.row.size() > 1 ? std::max(1, t0.row[1] - t0.row[0]) : 1, n = 2 * t0.kernel.half + 1;
  const bool from_speed = !t0.speed_raw.empty();
  double a = 0, b = 0;
  int free_column = 0;
  for (std::size_t c = 0; c < e.base_column.size() && c < 2; ++c) (c ? b : a) = e.base_column[c].given ? e.base_column[c].value : p[free_column++];
  std::vector<double> motion(std::size_t(n), 0.0), drive(std::size_t(n), 0.0);
  for (int k = 0; k < n; ++k) {
    auto i = std::size_t(k);
    motion[i] = from_speed ? a * t0.kernel.w[1][i] + b * t0.kernel.w[0][i] : a * t0.kernel.w[2][i] + b * t0.kernel.w[1][i];
    drive[i] = e.gain * t0.kernel.w[0][i];
  }
  const int lags = 5;
  double m[2][2] = {{0, 0}, {0, 0}}, v[2] = {0, 0};
  for (int l = 0; l < lags; ++l) {
    double r1 = 0, r0 = 0, c = 0, count = 0;
    for (int k = 0; k + l * step < n; ++k) r1 += motion[std::size_t(k)] * motion[std::size_t(k + l * step)], r0 += drive[std::size_t(k)] * drive[std::size_t(k + l * step)];
    for (const Track &t : e.tracks)
      for (std::size_t r = std::size_t(l); r < t.row.size(); ++r)
        if (t.run[r] == t.run[r - std::size_t(l)]) c += residual[Eigen::Index(t.first + r)] * residual[Eigen::Index(t.first + r) - l], count += 1;
    c /= std::max(1.0, count);
    double w = l ? 1 : 2;
    m[0][0] += w * r1 * r1; m[0][1] += w * r1 * r0; m[1][1] += w * r0 * r0;
    v[0] += w * r1 * c; v[1] += w * r0 * c;
  }
  double det = m[0][0] * m[1][1] - m[0][1] * m[0][1];
  double x = det > 0 ? (v[0] * m[1][1] - v[1] * m[0][1]) / det : 0, y = det > 0 ? (v[1] * m[0][0] - v[0] * m[0][1]) / det : 0;
  if (x < 0 || !(det > 0)) x = 0, y = m[1][1] > 0 ? v[1] / m[1][1] : 0;
  if (y < 0) y = 0, x = m[0][0] > 0 ? v[0] / m[0][0] : 0;
  e.noise_motion = std::max(0.0, x);
  e.noise_drive = std::max(0.0, y);
}

}  // namespace

BlockGram::BlockGram(const Equation &e, const Eigen::MatrixXd &x, const Eigen::VectorXd &y) : fold_(e.block_fold), held_(e.block_held_out) {
  const std::size_t blocks = e.block_held_out.size();
  const Eigen::Index n = x.cols();
  gram_.assign(blocks, Eigen::MatrixXd::Zero(n, n));
  xy_.assign(blocks, Eigen::VectorXd::Zero(n));
  yy_.assign(blocks, 0);
  rows_.assign(blocks, 0);
  std::size_t a = 0;
  while (a < e.rows) {   // blocks are contiguous stretches (of tracks)
    std::size_t b = a;
    while (b < e.rows && e.block[b] == e.block[a]) ++b;
    auto xs = x.middleRows(Eigen::Index(a), Eigen::Index(b - a));
    auto ys = y.segment(Eigen::Index(a), Eigen::Index(b - a));
    std::size_t k = std::size_t(e.block[a]);
    gram_[k].selfadjointView<Eigen::Lower>().rankUpdate(xs.transpose());
    xy_[k] += xs.transpose() * ys;
    yy_[k] += ys.squaredNorm();
    for (std::size_t r = a; r < b; ++r) rows_[k] += e.weight[r];
    a = b;
  }
  all_ = training_ = Eigen::MatrixXd::Zero(n, n);
  all_xy_ = training_xy_ = Eigen::VectorXd::Zero(n);
  for (std::size_t k = 0; k < blocks; ++k) {
    gram_[k].triangularView<Eigen::StrictlyUpper>() = gram_[k].transpose();
    all_ += gram_[k];
    all_xy_ += xy_[k];
    if (!held_[k]) training_ += gram_[k], training_xy_ += xy_[k];
    const std::size_t f = std::size_t(fold_[k]);
    if (f >= fold_gram_.size()) fold_gram_.resize(f + 1, Eigen::MatrixXd::Zero(n, n)), fold_xy_.resize(f + 1, Eigen::VectorXd::Zero(n));
    fold_gram_[f] += gram_[k];
    fold_xy_[f] += xy_[k];
  }
}

Eigen::VectorXd BlockGram::solve_without(const std::vector<int> &columns, const std::vector<double> &ridge, int fold, bool training_only) const {
  const Eigen::Index m = Eigen::Index(columns.size());
  Eigen::MatrixXd g(m, m);
  Eigen::VectorXd r(m);
  const Eigen::MatrixXd &source = training_only ? training_ : all_;
  const Eigen::VectorXd &sxy = training_only ? training_xy_ : all_xy_;
  for (Eigen::Index i = 0; i < m; ++i) {
    int ci = columns[std::size_t(i)];
    r[i] = sxy[ci] - (fold >= 0 ? fold_xy_[std::size_t(fold)][ci] : 0);
    for (Eigen::Index j = 0; j < m; ++j) g(i, j) = source(ci, columns[std::size_t(j)]) - (fold >= 0 ? fold_gram_[std::size_t(fold)](ci, columns[std::size_t(j)]) : 0);
  }
  Eigen::VectorXd d(m);
  for (Eigen::Index i = 0; i < m; ++i) d[i] = 1 / std::sqrt(std::max(all_(columns[std::size_t(i)], columns[std::size_t(i)]), 1e-300));
  g = d.asDiagonal() * g * d.asDiagonal();
  for (Eigen::Index i = 0; i < m; ++i) g(i, i) += 1e-9 + (ridge.empty() ? 0 : ridge[std::size_t(i)]);
  return d.asDiagonal() * g.ldlt().solve(d.asDiagonal() * r);
}

double BlockGram::block_sse(int block, const std::vector<int> &columns, const Eigen::VectorXd &p) const {
  const auto b = std::size_t(block);
  const Eigen::Index m = Eigen::Index(columns.size());
  double s = yy_[b];
  for (Eigen::Index i = 0; i < m; ++i) {
    double inner = 0;
    for (Eigen::Index j = 0; j < m; ++j) inner += gram_[b](columns[std::size_t(i)], columns[std::size_t(j)]) * p[j];
    s += p[i] * (inner - 2 * xy_[b][columns[std::size_t(i)]]);
  }
  return std::max(0.0, s);
}

BlockGram::Score BlockGram::cross_validate(const std::vector<int> &columns, const std::vector<double> &ridge) const {
  Score score;
  score.rows = rows_;
  Eigen::VectorXd p;
  for (std::size_t b = 0; b < gram_.size(); ++b) {
    if (b == 0 || fold_[b] != fold_[b - 1]) p = solve_without(columns, ridge, fold_[b], false);
    double s = block_sse(int(b), columns, p);
    score.sse.push_back(s);
    score.total += s;
  }
  p = solve_without(columns, ridge, -1, true);
  for (std::size_t b = 0; b < gram_.size(); ++b)
    if (held_[b]) score.held += block_sse(int(b), columns, p), score.held_rows += rows_[b];
  return score;
}

Eigen::VectorXd BlockGram::solve(const std::vector<int> &columns, const std::vector<double> &ridge, bool training_only) const {
  return solve_without(columns, ridge, -1, training_only);
}

Floor find_floor(Equation &e, const std::vector<Family> &families) {
  Floor f;
  Eigen::Index columns = e.base.cols();
  for (const Family &g : families) columns += g.column.cols();
  Eigen::MatrixXd x(Eigen::Index(e.rows), columns);
  x.leftCols(e.base.cols()) = e.base;
  Eigen::Index at = e.base.cols();
  for (const Family &g : families) x.middleCols(at, g.column.cols()) = g.column, at += g.column.cols();
  std::vector<int> base, all;
  for (int c = 0; c < int(columns); ++c) (c < int(e.base.cols()) ? base : all).push_back(c);
  all.insert(all.begin(), base.begin(), base.end());
  auto ridge_of = [&](double r) { std::vector<double> v(std::size_t(columns), r); for (std::size_t c = 0; c < base.size(); ++c) v[c] = 0; return v; };
  e.ar.clear();
  e.weight.assign(e.rows, 1.0);
  double best_ridge = 1e-3;
  for (int pass = 0; pass < 3; ++pass) {
    Eigen::MatrixXd wx = whiten(e, x);
    Eigen::VectorXd wy = whiten(e, e.y);
    BlockGram gram(e, wx, wy);
    double best = INFINITY;
    for (double r : {1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0}) {
      BlockGram::Score s = gram.cross_validate(all, ridge_of(r));
      if (s.total < best) best = s.total, best_ridge = r, f.flexible_block = s.sse;
    }
    BlockGram::Score nominal = gram.cross_validate(base, {});
    f.nominal_sse = nominal.total;
    f.nominal_block = nominal.sse;
    f.flexible_sse = best;
    f.rows = 0;
    for (double w : e.weight) f.rows += w;
    Eigen::VectorXd p = gram.solve(all, ridge_of(best_ridge), false);
    f.flexible = x.rightCols(columns - e.base.cols()) * p.tail(columns - e.base.cols());
    Eigen::VectorXd residual = e.y - x * p;
    f.hi = std::sqrt(residual.squaredNorm() / double(e.rows));
    if (pass == 1) {
      mask_outliers(e, residual);
      if (!e.mask.empty())
        for (Eigen::Index k = 0; k < residual.size(); ++k)
          if (e.mask[std::size_t(k)]) residual[k] = 0;
    }
    if (pass < 2) fit_whitening(e, residual, kArOrder);
    if (pass == 2) split_noise(e, residual, p);
  }
  f.lo = std::min(e.floor_lo, f.hi);
  return f;
}

}  // namespace driveid::diagnose
