// SPDX-License-Identifier: Apache-2.0
// What every equation gets once its tracks stand: target, base columns, the instant of its input, blocks.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "diagnose/equation_build.hpp"

namespace driveid::diagnose {
namespace {

constexpr int kBlocksOfFold = 4;

// Contiguous folds: about six of the training records and six of the held-out ones, or ten with three set aside; four blocks in each.
void make_blocks(Equation &e) {
  int records = 0;
  bool any_held = false;
  for (const Track &t : e.tracks) records = std::max(records, t.record + 1), any_held |= t.held_out;
  std::vector<std::size_t> rows(std::size_t(records), 0);
  std::vector<unsigned char> held(std::size_t(records), 0);
  for (const Track &t : e.tracks) rows[std::size_t(t.record)] += t.row.size(), held[std::size_t(t.record)] = t.held_out;
  int trainings = 0, helds = 0;
  for (int r = 0; r < records; ++r) (held[std::size_t(r)] ? helds : trainings) += rows[std::size_t(r)] > 0;
  e.block.assign(e.rows, 0);
  e.block_held_out.clear();
  e.block_fold.clear();
  int folds = 0;
  std::vector<int> base(std::size_t(records), 0), blocks(std::size_t(records), 1);
  for (int r = 0; r < records; ++r) {
    int many = any_held ? 6 : 10, sharing = held[std::size_t(r)] ? helds : trainings;
    blocks[std::size_t(r)] = std::max(2, (many + sharing - 1) / std::max(1, sharing));
    base[std::size_t(r)] = int(e.block_held_out.size());
    for (int b = 0; b < blocks[std::size_t(r)]; ++b, ++folds)
      for (int part = 0; part < kBlocksOfFold; ++part) {
        e.block_held_out.push_back(any_held ? held[std::size_t(r)] : blocks[std::size_t(r)] == 2 ? b == 1 : b % 3 == 1 && b < 9);
        e.block_fold.push_back(folds);
      }
  }
  std::vector<std::size_t> seen(std::size_t(records), 0);
  for (const Track &t : e.tracks)
    for (std::size_t k = 0; k < t.row.size(); ++k) {
      auto r = std::size_t(t.record);
      const int many = blocks[r] * kBlocksOfFold, b = int(seen[r] * std::size_t(many) / std::max<std::size_t>(1, rows[r]));
      e.block[t.first + k] = base[r] + std::min(b, many - 1);
      ++seen[r];
    }
}

double rms_with(const Equation &e, const Eigen::MatrixXd &x, const Eigen::VectorXd &y) {
  Eigen::VectorXd scale = (x.colwise().norm().array() + 1e-300).matrix();
  Eigen::MatrixXd q = x * scale.cwiseInverse().asDiagonal();
  Eigen::MatrixXd g = q.transpose() * q;
  g.diagonal().array() += 1e-10;
  Eigen::VectorXd p = g.ldlt().solve(q.transpose() * y);
  return std::sqrt((y - q * p).squaredNorm() / double(std::max<std::size_t>(1, e.rows)));
}

// Held (+dt/2), instant (0) or averaged over the sample before (-dt/2): whichever leaves least, beside friction that may be missing.
void detect_hold(Equation &e, double dt, const std::string &told, std::vector<Notice> &notices) {
  if (told == "average") { e.input_shift_s = -0.5 * dt; return; }
  if (told == "zoh") { e.input_shift_s = 0.5 * dt; return; }
  if (told == "instant") { e.input_shift_s = 0; return; }
  Eigen::MatrixXd x(Eigen::Index(e.rows), e.base.cols() + 3);
  x.leftCols(e.base.cols()) = e.base;
  x.col(e.base.cols()) = stack(e, [&](const Track &t, std::vector<double> &f) { f.resize(t.state.size()); for (std::size_t k = 0; k < f.size(); ++k) f[k] = e.electrical ? (t.state[k].current_A > 0 ? 1.0 : -1.0) : t.state[k].direction; }, 0);
  x.col(e.base.cols() + 1).setOnes();
  x.col(e.base.cols() + 2) = stack(e, [](const Track &t, std::vector<double> &f) { f.resize(t.state.size()); for (std::size_t k = 0; k < f.size(); ++k) f[k] = std::fabs(t.state[k].speed) * t.state[k].speed; }, 0);
  Eigen::VectorXd known = delayed_target(e, 0) - e.y;   // given terms, not shifted
  // In a voltage equation half a sample is nearly collinear with R i: the mean over the sample is assumed unless the data object.
  double best = INFINITY, chosen = 0;
  const auto passive = [&](const Eigen::VectorXd &y) {   // a winding has a resistance and an inductance
    const Eigen::VectorXd p = x.colPivHouseholderQr().solve(y);
    int column = 0;
    for (const BaseColumn &b : e.base_column) {
      if (b.given) continue;
      if ((b.name[0] == 'R' || b.name[0] == 'L') && p[column] < 0) return false;
      ++column;
    }
    return true;
  };
  std::vector<double> shifts{-0.5, 0.0, 0.5};
  if (!e.electrical) {   // the skew between current and angle lies anywhere within half a sample, a differenced speed lags by as much again
    shifts.clear();
    for (int k = -5; k <= (e.tracks[0].speed_raw.empty() ? 5 : 10); ++k) shifts.push_back(0.1 * k);
  }
  for (double s : shifts) {
    const Eigen::VectorXd y = delayed_target(e, s * dt) - known;
    const double r = rms_with(e, x, y);
    if (e.electrical && best < INFINITY && !passive(y)) continue;
    if (r < (best == INFINITY || !e.electrical ? 1.0 : 0.98) * best) best = r, chosen = s;
  }
  e.input_shift_s = chosen * dt;
  chosen = chosen < -0.25 ? -0.5 : chosen > 0.25 ? 0.5 : 0;
  const char *what = chosen < 0 ? "averaged over the sample before its stamp" : chosen > 0 ? "held from its stamp to the next" : "an instant value at its stamp";
  notices.push_back({"hold", std::string("the input of the ") + e.signal + " equation is read as " + what + " (detected; --hold says otherwise)", ""});
}

void reshift_states(Equation &e) {
  for (Track &t : e.tracks) {
    const std::size_t n = t.state.size();
    const double shift = e.input_shift_s / t.dt_s, whole = std::floor(shift), part = shift - whole;
    for (std::size_t k = 0; k < n; ++k) {
      auto at = [&](double index) { return t.drive_raw[std::size_t(std::clamp(index, 0.0, double(n - 1)))]; };
      t.state[k].drive = (1 - part) * at(double(k) - whole) + part * at(double(k) - whole - 1);
      t.state[k].torque = t.state[k].gain * t.state[k].drive;
    }
  }
}

}  // namespace

const driveid_param *parameter(const driveid_model &model, const char *name) {
  for (unsigned k = 0; k < model.params; ++k)
    if (!std::strcmp(model.param[k].name, name)) return &model.param[k];
  return nullptr;
}

void finish(Equation &e) {
  e.rows = 0;
  for (Track &t : e.tracks) t.first = e.rows, e.rows += t.row.size();
  e.y = e.drive = delayed_target(e, 0);
  e.weight.assign(e.rows, 1.0);
}

void add_column(Equation &e, const driveid_model &model, const char *name, const Eigen::VectorXd &column) {
  const driveid_param *p = parameter(model, name);
  if (p && p->state == DRIVEID_PARAM_GIVEN) {
    e.y -= p->value * column;
    e.base_column.push_back({name, true, p->value});
    return;
  }
  e.base.conservativeResize(Eigen::Index(e.rows), e.base.cols() + 1);
  e.base.col(e.base.cols() - 1) = column;
  e.base_column.push_back({name, false, 0});
}

void add_base(Equation &e, const driveid_model &model, const char *name, const FineSignal &signal, int derivative, double sign) {
  add_column(e, model, name, sign * stack(e, signal, derivative));
}

// The input's own instant, then the target and the states with it, then the blocks.
void settle(Equation &e, const Source &source, std::vector<Notice> &notices) {
  const Eigen::VectorXd before = delayed_target(e, 0);
  detect_hold(e, source.record->dt_s, source.record->hold, notices);
  e.drive = delayed_target(e, 0);
  e.y += e.drive - before;
  reshift_states(e);
  make_blocks(e);
}

}  // namespace driveid::diagnose
