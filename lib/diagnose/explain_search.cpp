// SPDX-License-Identifier: Apache-2.0
#include "diagnose/explain_search.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <thread>

#include "diagnose/evidence.hpp"

namespace driveid::diagnose {
namespace {

constexpr std::size_t kThinRows = 3500;

}  // namespace

Search::Search(Equation equation, std::vector<Candidate> candidates, int threads)
    : full_(std::move(equation)), thin_(thinned(full_, kThinRows)), candidates_(std::move(candidates)), known_(candidates_.size()), threads_(std::max(1, threads)) {
  for (double w : full_.weight) rows_ += w > 0;
  Solution s = solve({});
  int free_column = 0;
  for (const BaseColumn &b : full_.base_column) {
    double v = b.given ? b.value : s.coefficient[free_column++];
    if (&b == &full_.base_column[0]) nominal_.inertia = v;
    else if (full_.base_column.size() > 1 && &b == &full_.base_column[1]) nominal_.damping = v;
  }
}

void Search::weigh(std::vector<double> weight) {
  full_.weight = std::move(weight);
  thin_ = thinned(full_, kThinRows);
}

Search::View Search::view(const Equation &e, const std::vector<Member> &members) const {
  View v;
  v.equation = &e;
  v.z = whiten(e, e.base);
  v.y = whiten(e, e.y);
  for (const Member &m : members) {
    Term t = realise(e, candidates_[std::size_t(m.candidate)], m.shape, nominal_);
    if (t.column.cols()) put_beside(v.z, whiten(e, t.column));
    if (t.taken.size()) v.y -= whiten(e, t.taken);
  }
  v.scale = (v.z.colwise().norm().array() + 1e-300).matrix().transpose().cwiseInverse();
  Eigen::MatrixXd zs = v.z * v.scale.asDiagonal();
  v.z = zs;
  Eigen::MatrixXd g = zs.transpose() * zs;
  g.diagonal().array() += 1e-10;
  v.factor.compute(g);
  v.zy = v.factor.solve(zs.transpose() * v.y);
  v.r = v.y - zs * v.zy;
  v.rr = v.r.squaredNorm();
  return v;
}

double Search::left(const View &v, const Candidate &c, const std::vector<double> &shape) const {
  Term t = realise(*v.equation, c, shape, nominal_);
  Eigen::VectorXd r = v.r, zy = v.zy;
  if (t.taken.size()) {
    Eigen::VectorXd taken = whiten(*v.equation, t.taken), zt = v.factor.solve(v.z.transpose() * taken);
    r -= taken - v.z * zt;
    zy -= zt;
  }
  double sse = r.squaredNorm();
  Eigen::VectorXd linear;
  if (t.column.cols()) {
    Eigen::MatrixXd x = whiten(*v.equation, t.column), xz = v.z.transpose() * x, a = v.factor.solve(xz), s = x.transpose() * x;
    Eigen::VectorXd before = s.diagonal();
    s -= xz.transpose() * a;
    for (Eigen::Index k = 0; k < s.rows(); ++k)
      if (!(s(k, k) > 1e-7 * before[k]) || !(before[k] > 0)) return INFINITY;
    Eigen::VectorXd d = s.diagonal().cwiseSqrt().cwiseInverse();
    Eigen::MatrixXd n = d.asDiagonal() * s * d.asDiagonal();
    n.diagonal().array() += 1e-9;
    Eigen::VectorXd b = x.transpose() * r;
    linear = d.asDiagonal() * n.ldlt().solve(d.asDiagonal() * b);
    sse = r.squaredNorm() - 2 * linear.dot(b) + linear.dot(s * linear);
    zy -= a * linear;
  }
  double inertia = full_.base_column.empty() ? 0 : full_.base_column[0].given ? full_.base_column[0].value : zy[0] * v.scale[0];
  if (t.drive_part.size()) {
    double factor = drive_factor(t, linear);
    if (!(factor > 0.2 && factor < 5)) return INFINITY;
    linear /= factor;
  } else if (t.drive_scale < 0.15) {
    return INFINITY;
  }
  if (!lawful(full_, c, shape, linear, inertia)) return INFINITY;
  return sse / noise_ratio(*v.equation, c, shape, linear, inertia, nominal_.damping);
}

void Search::refine_shape(const View &v, const Candidate &c, std::vector<double> &shape, double &best, int rounds) const {
  std::vector<double> step(shape.size());
  for (std::size_t a = 0; a < shape.size(); ++a) {
    const ShapeAxis &x = c.axis[a];
    if (x.grid.size() < 2) step[a] = x.logarithmic ? std::log(2.0) : 0.25 * (x.hi - x.lo);
    else if (x.logarithmic) step[a] = 0.5 * std::log(x.grid[1] / x.grid[0]);
    else {
      std::size_t j = 0;
      while (j + 2 < x.grid.size() && x.grid[j + 1] <= shape[a]) ++j;
      step[a] = 0.5 * (x.grid[j + 1] - x.grid[j]);
    }
    if (x.whole) step[a] = 0;
  }
  for (int round = 0; round < rounds; ++round) {
    bool moved = false;
    for (std::size_t a = 0; a < shape.size(); ++a) {
      if (step[a] == 0) continue;
      const ShapeAxis &x = c.axis[a];
      for (double direction : {1.0, -1.0}) {
        for (int go = 0; go < 6; ++go) {
          std::vector<double> next = shape;
          next[a] = x.logarithmic ? shape[a] * std::exp(direction * step[a]) : shape[a] + direction * step[a];
          next[a] = std::clamp(next[a], x.lo, x.hi);
          if (next[a] == shape[a]) break;
          double s = left(v, c, next);
          if (!(s < best)) break;
          best = s;
          shape = next;
          moved = true;
          if (go == 0) continue;
        }
      }
    }
    if (!moved || round % 2)
      for (double &s : step) s *= 0.4;
  }
}

double Search::raw_square(const Eigen::VectorXd &white) const {
  double sum = 0;
  const int p = int(full_.ar.size());
  std::vector<double> e;
  for (const Track &track : full_.tracks) {
    e.assign(track.row.size(), 0.0);
    int age = 0, run = -1;
    for (std::size_t r = 0; r < track.row.size(); ++r) {
      age = track.run[r] == run ? age + 1 : 0;
      run = track.run[r];
      if (age < p) continue;
      const double weight = full_.weight[track.first + r];
      e[r] = weight > 0 ? white[Eigen::Index(track.first + r)] / weight : 0;
      for (int j = 1; j <= p; ++j) e[r] += full_.ar[std::size_t(j - 1)] * e[r - std::size_t(j)];
      sum += e[r] * e[r];
    }
  }
  return sum;
}

Search::Context Search::context(const std::vector<Member> &members) const {
  Context c;
  c.members = members;
  c.full = view(full_, members);
  c.thin = view(thin_, members);
  std::vector<int> all;
  for (int k = 0; k < int(c.full.z.cols()); ++k) all.push_back(k);
  c.score = BlockGram(full_, c.full.z, c.full.y).cross_validate(all, {});
  c.raw = raw_square(c.full.r);
  return c;
}

// What dry friction and other losses of the members take off the drive before the shaft, per track on the fine grid.
std::vector<std::vector<double>> Search::losses(const std::vector<Member> &members, const Eigen::VectorXd &coefficient) const {
  std::vector<std::vector<double>> out;
  Eigen::Index at = full_.base.cols();
  for (const Member &m : members) {
    const Candidate &c = candidates_[std::size_t(m.candidate)];
    const bool law = c.info && c.info->columns == c.columns && !(c.info->fixed & 1) && c.columns > 0;   // a law of the state at this instant
    if (law && out.empty())
      for (const Track &t : full_.tracks) out.emplace_back(t.state.size(), 0.0);
    for (std::size_t k = 0; law && k < out.size(); ++k) {
      double memory[DRIVEID_EFFECT_MEMORY] = {0, 0, 0, 0}, column[DRIVEID_EFFECT_COLUMNS_MAX] = {0, 0, 0, 0};
      for (std::size_t j = 0; j < out[k].size(); ++j) {
        c.info->fill(m.shape.data(), &full_.tracks[k].state[j], memory, column);
        for (int q = 0; q < c.columns; ++q)
          if (std::isfinite(column[q])) out[k][j] += coefficient[at + q] * column[q];
      }
    }
    at += realise(full_, c, m.shape, nominal_).column.cols();
  }
  return out;
}

// Share of the squared error that a spring leaves when the drive, not the motion, passes through it: a real one explains both ways, a filter
// of the motion's noise does not ring on the drive. Losses lie on either side of the shaft: the better of both is believed.
double Search::seen_from_drive(const Context &context, const std::vector<double> &shape, const Eigen::VectorXd &p) const {
  const double inertia = full_.base_column[0].given ? full_.base_column[0].value : p[0] * context.full.scale[0];
  Eigen::VectorXd unscaled = p.head(context.full.scale.size()).cwiseProduct(context.full.scale);
  std::vector<int> base;
  for (int k = 0; k < int(context.full.z.cols()); ++k) base.push_back(k);
  double best = INFINITY;
  std::vector<std::vector<double>> lost = losses(context.members, unscaled);
  for (int side = 0; side < (lost.empty() ? 1 : 2); ++side) {
    const Eigen::VectorXd taken = whiten(full_, spring_on_drive(full_, inertia, p[p.size() - 1], shape[0], shape[1], side ? lost : std::vector<std::vector<double>>{}));
    best = std::min(best, BlockGram(full_, context.full.z, context.full.y - taken).cross_validate(base, {}).total);
  }
  return best / std::max(1e-300, context.score.total);
}

// A dead zone leaves a deficit well above its threshold too; below it, what is swallowed may be noise on both sides of the equation.
bool Search::less_above_threshold(const std::vector<Member> &members, int candidate, const std::vector<double> &shape, double share) const {
  const Eigen::VectorXd before = solve(members).residual, after = solve(joined(members, candidate, shape)).residual;
  double was = 0, is_now = 0, rows = 0;
  for (Eigen::Index k = 0; k < before.size(); ++k)
    if (std::fabs(full_.drive[k]) > 2 * full_.gain * shape[0]) was += before[k] * before[k], is_now += after[k] * after[k], rows += 1;
  return rows > 0.05 * double(before.size()) && is_now < (1 - 0.5 * share) * was;
}

Option Search::judged(int index, const Context &context, const std::vector<double> &shape, const Context &against) const {
  const Candidate &c = candidates_[std::size_t(index)];
  Option o;
  o.candidate = index;
  o.shape = shape;
  Term t = realise(full_, c, shape, nominal_);
  Eigen::MatrixXd z = context.full.z;
  Eigen::VectorXd y = context.full.y;
  if (t.column.cols()) put_beside(z, whiten(full_, t.column));
  if (t.taken.size()) y -= whiten(full_, t.taken);
  std::vector<int> all;
  for (int k = 0; k < int(z.cols()); ++k) all.push_back(k);
  BlockGram gram(full_, z, y);
  BlockGram::Score score = gram.cross_validate(all, {});
  {
    Eigen::VectorXd p = gram.solve(all, {}, false);
    double inertia = full_.base_column.empty() ? 0 : full_.base_column[0].given ? full_.base_column[0].value : p[0] * context.full.scale[0];
    o.noise = noise_ratio(full_, c, shape, p.tail(t.column.cols()), inertia, nominal_.damping);
    if (o.noise != 1) {
      score.total /= o.noise;
      score.held /= o.noise;
      for (double &s : score.sse) s /= o.noise;
    }
  }
  const Eigen::VectorXd left = y - z * gram.solve(all, {}, false);
  o.raw = raw_square(left) / o.noise;
  if (c.name != "dead_zone" && c.trials <= 1) o.consistency = consistency(against.full.r, left);   // a threshold meets the drive's noise everywhere, and of many places or instants one always fits
  o.possible = true;
  o.sse = score.sse;
  o.total = score.total;
  o.gain = 0.5 * rows_ * std::log(against.score.total / std::max(score.total, 1e-300));
  o.relative = 1 - score.total / against.score.total;
  o.held_gain = score.held_rows > 0 ? 0.5 * score.held_rows * std::log(against.score.held / std::max(score.held, 1e-300)) : 0;
  o.held_share = score.held_rows / std::max(1.0, rows_);
  o.evidence = evidence(against.score.sse, score.sse);
  o.broad = broad(against.score.sse, score.sse);
  o.relative_raw = 1 - o.raw / std::max(context.raw, 1e-300);
  // Whitening weighs the noise's own frequencies up: what is gained there more than in the error as it stands may be noise that is swallowed.
  const bool plain = o.relative_raw >= o.relative;
  if (c.name == "dead_zone") o.possible = plain && less_above_threshold(context.members, index, shape, o.relative_raw);
  if (c.name == "compliance" && t.column.cols() && !plain) o.check = seen_from_drive(context, shape, gram.solve(all, {}, false));
  o.cost = 1.0 * double(t.column.cols()) + 2.0 * double(shape.size()) + std::log(c.trials);
  return o;
}

Option Search::try_candidate(int index, const Context &context, const Context &against, const std::vector<std::vector<double>> &seeds) const {
  const Candidate &c = candidates_[std::size_t(index)];
  Option none;
  none.candidate = index;
  std::vector<std::vector<double>> grid{{}};
  for (const ShapeAxis &x : c.axis) {
    std::vector<std::vector<double>> next;
    for (const auto &g : grid)
      for (double v : x.grid) next.push_back(g), next.back().push_back(v);
    grid = std::move(next);
  }
  for (const auto &s : seeds) grid.push_back(s);
  std::vector<std::pair<double, std::size_t>> scored;
  if (grid.size() > 1) {
    for (std::size_t k = 0; k < grid.size(); ++k) scored.push_back({left(context.thin, c, grid[k]), k});
    std::sort(scored.begin(), scored.end());
  } else {
    scored.push_back({0, 0});
  }
  double best = INFINITY;
  std::vector<double> shape;
  std::size_t tries = c.axis.empty() ? 1 : c.trials > 1 || c.name == "backlash" ? 4 : 2;   // impacts make the error rugged
  for (std::size_t k = 0; k < scored.size() && k < tries; ++k) {
    if (!std::isfinite(scored[k].first)) break;
    std::vector<double> s = grid[scored[k].second];
    double v = left(context.full, c, s);
    if (v < best) best = v, shape = s;
  }
  if (!std::isfinite(best)) return none;
  if (!c.axis.empty() && !shape.empty()) {
    if (thin_.rows < full_.rows && !c.axis[0].whole && c.axis.size() > 1) {   // most of the way on the stretches
      double b = left(context.thin, c, shape);
      std::vector<double> s = shape;
      refine_shape(context.thin, c, s, b, 5);
      double v = left(context.full, c, s);
      if (v < best) best = v, shape = s;
      refine_shape(context.full, c, shape, best, 2);
    } else {
      refine_shape(context.full, c, shape, best, 5);
    }
  }
  return judged(index, context, shape, against);
}

std::vector<Member> Search::joined(const std::vector<Member> &members, int candidate, const std::vector<double> &shape) const {
  std::vector<Member> out;
  for (const Member &m : members)
    if (!subsumes(candidates_[std::size_t(candidate)], candidates_[std::size_t(m.candidate)])) out.push_back(m);
  out.push_back({candidate, shape, false});
  return out;
}

std::vector<Option> Search::offer(const std::vector<Member> &members, const std::vector<int> &skip) {
  std::map<std::vector<int>, std::unique_ptr<Context>> contexts;
  std::vector<Context *> of(candidates_.size(), nullptr);
  BlockGram::Score against;
  for (std::size_t k = 0; k < candidates_.size(); ++k) {
    bool skipped = std::find(skip.begin(), skip.end(), int(k)) != skip.end();
    bool repeats = candidates_[k].info && candidates_[k].info->repeats;
    std::vector<Member> others;
    std::vector<int> key;
    for (const Member &m : members) {
      if (m.candidate == int(k) && !repeats) skipped = true;
      if (subsumes(candidates_[std::size_t(m.candidate)], candidates_[k])) skipped = true;
      if (subsumes(candidates_[k], candidates_[std::size_t(m.candidate)])) continue;
      others.push_back(m);
      key.push_back(m.candidate);
    }
    if (skipped) continue;
    auto &slot = contexts[key];
    if (!slot) slot = std::make_unique<Context>(context(others));
    of[k] = slot.get();
  }
  std::vector<int> whole;
  for (const Member &m : members) whole.push_back(m.candidate);
  if (!contexts.count(whole)) contexts[whole] = std::make_unique<Context>(context(members));
  against = contexts[whole]->score;
  const double raw_before = contexts[whole]->raw;
  std::vector<Option> out(candidates_.size());
  std::atomic<std::size_t> next{0}, finished{0};
  std::atomic<bool> stop{false};
  auto work = [&](bool reports) {
    for (;;) {
      std::size_t k = next++;
      if (k >= candidates_.size() || stop) return;
      out[k].candidate = int(k);
      if (of[k]) {
        std::vector<std::vector<double>> seeds;
        if (!known_[k].empty()) seeds.push_back(known_[k]);
        Option o = try_candidate(int(k), *of[k], *contexts[whole], seeds);
        if (o.possible) {
          o.unchecked = o.total;
          if (o.check >= 0) {   // believe the side that explains less
            double offered = of[k]->score.total, believed = offered * (1 - 1.5 * std::max(0.0, 1 - o.check));
            if (believed > o.total) {
              for (double &s : o.sse) s *= believed / o.total;
              o.total = believed;
            }
          }
          o.gain = 0.5 * rows_ * std::log(against.total / std::max(o.total, 1e-300));
          o.relative = 1 - o.total / against.total;
          o.evidence = evidence(against.sse, o.sse);
          o.broad = broad(against.sse, o.sse);
          o.relative_raw = 1 - o.raw / std::max(raw_before, 1e-300);
        }
        out[k] = o;
      }
      ++finished;
      if (reports && tick_ && !tick_(double(finished) / double(candidates_.size()))) stop = true;
    }
  };
  std::vector<std::thread> pool;
  for (int k = 1; k < threads_; ++k) pool.emplace_back(work, false);
  work(true);
  for (auto &t : pool) t.join();
  cancelled_ |= stop;
  // A gap must beat the spring it contains by something of its own; else it is the spring.
  int spring = -1, gap = -1;
  for (std::size_t k = 0; k < out.size(); ++k) {
    if (out[k].possible && candidates_[k].name == "compliance") spring = int(k);
    if (out[k].possible && candidates_[k].name == "backlash") gap = int(k);
  }
  if (spring >= 0 && gap >= 0) {
    Option &g = out[std::size_t(gap)], &s = out[std::size_t(spring)];
    double own = 0.5 * rows_ * std::log(s.unchecked / std::max(g.total, 1e-300));   // beyond the spring taken at its word
    if (own < std::max(25.0, 0.1 * g.gain)) g.possible = false;
  }
  for (std::size_t k = 0; k < out.size(); ++k)
    if (out[k].possible && !out[k].shape.empty()) known_[k] = out[k].shape;
  return out;
}

Option Search::refine(int candidate, const std::vector<Member> &members, const std::vector<double> &from) {
  std::vector<Member> others;
  for (const Member &m : members)
    if (!subsumes(candidates_[std::size_t(candidate)], candidates_[std::size_t(m.candidate)])) others.push_back(m);
  Context c = context(others);
  std::vector<double> shape = from;
  double best = left(c.full, candidates_[std::size_t(candidate)], shape);
  refine_shape(c.full, candidates_[std::size_t(candidate)], shape, best, 5);
  return judged(candidate, c, shape, others.size() == members.size() ? c : context(members));
}

void Search::polish(std::vector<Member> &members) {
  if (members.size() < 2) return;
  for (std::size_t m = 0; m < members.size(); ++m) {
    const Candidate &c = candidates_[std::size_t(members[m].candidate)];
    if (members[m].kept || c.axis.empty()) continue;
    std::vector<Member> others;
    for (std::size_t k = 0; k < members.size(); ++k)
      if (k != m) others.push_back(members[k]);
    View v = view(full_, others);
    double best = left(v, c, members[m].shape);
    refine_shape(v, c, members[m].shape, best, 4);
  }
}

}  // namespace driveid::diagnose
