// SPDX-License-Identifier: Apache-2.0
#include "diagnose/explain_core.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "diagnose/evidence.hpp"

namespace driveid::diagnose {
namespace {

constexpr double kWorthMin = 14;        // log-likelihood beyond cost that an effect must bring
constexpr double kRelativeMin = 0.005;  // and the share of the squared error
constexpr double kRelativeElectrical = 0.02;   // the current's noise biases a winding's resistance, and the bias looks like an effect
constexpr double kElsewhereMin = 5;     // of the gain, what must be left without its best tenth of the blocks
constexpr double kBroadMin = 0.2;       // or this share of it
constexpr double kBroadGain = 200;      // where that is this much
constexpr double kEvidenceMin = 2.5;    // and over blocks: not in one place only
constexpr double kConsistencyMin = 3;   // or where the effect speaks at all: the same in at least nine stretches' worth
constexpr double kNearlyAll = 0.01;     // what a simpler law may leave of what the best one takes
constexpr double kBehindEvidence = 5;   // a family that does better in an effect's place must do so nearly everywhere,
constexpr double kBehindSpeed = 0.1;    // and by this share: dry friction is idealised at rest,
constexpr double kBehind = 0.05;        // other laws less,
constexpr double kBehindExact = 0.01;   // an eccentric scale is geometry
constexpr double kFurtherMin = 0.002;   // of what the accepted effects took: every law is an idealisation to a few per cent (squared here)

bool acceptable(const Search &search, const Option &o) {
  const double least = search.equation().electrical ? kRelativeElectrical : kRelativeMin;
  const bool in_places = o.evidence > kEvidenceMin || o.consistency > kConsistencyMin || (o.evidence > 1 && o.broad > kBroadMin && o.broad * o.gain > kBroadGain);
  return o.possible && o.gain > 0 && o.worth() > kWorthMin && o.relative > least && o.relative_raw > least && o.broad * o.gain > kElsewhereMin && in_places && o.held_gain > 0;
}

int complexity(const Search &s, const Option &o) {
  const Candidate &c = s.candidates()[std::size_t(o.candidate)];
  return c.columns + 2 * int(c.axis.size());
}

// Best by worth; a simpler one within the tolerance of the best is preferred.
int pick(const Search &s, const std::vector<Option> &options) {
  int best = -1;
  for (std::size_t k = 0; k < options.size(); ++k)
    if (acceptable(s, options[k]) && (best < 0 || options[k].worth() > options[std::size_t(best)].worth())) best = int(k);
  if (best < 0) return best;
  const Option &top = options[std::size_t(best)];
  double tolerance = std::max(4.0, 0.01 * top.gain);
  int chosen = best;
  auto as_good = [&](const Option &o) {   // within the tolerance, or a little more where the blocks do not decide
    return o.worth() > top.worth() - tolerance || (o.worth() > top.worth() - 3 * tolerance && evidence(o.sse, top.sse) < kEvidenceMin);
  };
  for (std::size_t k = 0; k < options.size(); ++k) {
    if (!acceptable(s, options[k]) || !as_good(options[k])) continue;
    int a = complexity(s, options[k]), b = complexity(s, options[std::size_t(chosen)]);
    if (a < b || (a == b && options[k].worth() > options[std::size_t(chosen)].worth())) chosen = int(k);
  }
  // On a quiet record the likelihood sees any idealisation: a simpler law that takes nearly all of what the best takes comes first,
  // and the richer one may replace it later for what it still takes.
  for (std::size_t k = 0; k < options.size(); ++k) {
    if (!acceptable(s, options[k]) || complexity(s, options[k]) >= complexity(s, options[std::size_t(chosen)])) continue;
    const double taken = top.total / std::max(1e-9, 1 - top.relative) - top.total;
    if (options[k].total - top.total < kNearlyAll * taken) chosen = int(k);
  }
  return chosen;
}

std::vector<Member> without(const std::vector<Member> &members, std::size_t index) {
  std::vector<Member> out;
  for (std::size_t k = 0; k < members.size(); ++k)
    if (k != index) out.push_back(members[k]);
  return out;
}

// The set without one member; what it took the place of in the user's model stands again.
std::vector<Member> without(const std::vector<Member> &members, std::size_t index, const std::vector<Member> &kept) {
  std::vector<Member> out = without(members, index);
  for (const Member &k : kept)
    if (std::none_of(members.begin(), members.end(), [&](const Member &m) { return m.kept && m.candidate == k.candidate; })) out.push_back(k);
  return out;
}

// Each member is asked again: would the set be as good without it, or better with another in its place?
bool reexamine(Search &search, std::vector<Member> &chosen, const std::vector<Member> &kept) {
  bool changed = false;
  for (std::size_t m = 0; m < chosen.size() && chosen.size() > 1; ++m) {
    if (chosen[m].kept) continue;
    std::vector<Member> others = without(chosen, m, kept);
    std::vector<Option> options = search.offer(others);
    for (Option &o : options)   // a load beside symmetric friction was weighed against asymmetry when it was chosen
      if (search.candidates()[std::size_t(o.candidate)].name == "asymmetric_friction" && o.candidate != chosen[m].candidate) o.possible = false;
    Option self = search.refine(chosen[m].candidate, others, chosen[m].shape);
    const double removed = self.possible ? self.total / std::max(1e-9, 1 - self.relative) - self.total : 0;
    for (Option &o : options)   // a richer effect takes the place of a simpler one for something that can be seen
      if (self.possible && o.possible && o.candidate != self.candidate && complexity(search, o) > complexity(search, self) && self.total - o.total < 0.02 * removed) o.possible = false;
    int best = pick(search, options);
    if (!acceptable(search, self) && best < 0) {
      if (!search.sound(others)) continue;
      chosen = others;
      return true;
    }
    if (best >= 0 && options[std::size_t(best)].candidate != chosen[m].candidate && options[std::size_t(best)].worth() > self.worth() + 4) {
      const std::vector<Member> other = search.joined(others, options[std::size_t(best)].candidate, options[std::size_t(best)].shape);
      if (!search.sound(other)) continue;   // what stands beside it leans on this member
      chosen = other;
      return true;
    }
    if (self.possible) chosen[m].shape = self.shape;
  }
  return changed;
}

// Asymmetric friction beside another dry friction is as well that friction beside a load, the commoner machine and the simpler law.
void simplify_asymmetry(Search &search, std::vector<Member> &chosen) {
  int load = -1;
  for (std::size_t c = 0; c < search.candidates().size(); ++c)
    if (search.candidates()[c].name == "constant_load") load = int(c);
  if (load < 0) return;
  auto name = [&](const Member &m) { return search.candidates()[std::size_t(m.candidate)].name; };
  for (std::size_t m = 0; m < chosen.size(); ++m) {
    if (chosen[m].kept || name(chosen[m]) != "asymmetric_friction") continue;
    std::vector<Member> others = without(chosen, m), rest;
    bool dry = false;
    for (const Member &o : others) {
      const bool is_dry = !o.kept && (name(o) == "stribeck" || name(o) == "lugre" || name(o) == "hysteresis");
      dry |= is_dry;
      if (!is_dry) rest.push_back(o);
    }
    if (!dry) return;
    rest.push_back({load, {}, false});
    std::vector<Option> options = search.offer(rest);
    const int best = pick(search, options);
    if (best < 0) return;
    std::vector<Member> simpler = search.joined(rest, options[std::size_t(best)].candidate, options[std::size_t(best)].shape);
    if (search.solve(simpler).score.total < 1.05 * search.solve(chosen).score.total) chosen = simpler;
    return;
  }
}

}  // namespace

// Is less left where the drive stands clear of its noise? A family made of the drive can take that noise back where the axis rests,
// and explains nothing by it.
bool less_under_drive(const Equation &e, const Eigen::MatrixXd &z, const Eigen::VectorXd &y, const BlockGram &gram, const std::vector<int> &now, const std::vector<double> &ridge_now,
                      const std::vector<int> &with, const std::vector<double> &ridge_with) {
  const auto left = [&](const std::vector<int> &columns, const std::vector<double> &ridge) {
    const Eigen::VectorXd p = gram.solve(columns, ridge, false);
    Eigen::VectorXd r = y;
    for (std::size_t k = 0; k < columns.size(); ++k) r -= p[Eigen::Index(k)] * z.col(columns[k]);
    double sum = 0;
    for (Eigen::Index k = 0; k < r.size(); ++k)
      if (std::fabs(e.drive[k]) > 5 * e.gain * e.input_noise) sum += r[k] * r[k];
    return sum;
  };
  return left(with, ridge_with) < 0.95 * left(now, ridge_now);
}

void add_members(const Search &search, const std::vector<Member> &members, Eigen::MatrixXd &x, Eigen::VectorXd &y) {
  for (const Member &m : members) {
    Term t = realise(search.equation(), search.candidates()[std::size_t(m.candidate)], m.shape, search.nominal());
    if (t.column.cols()) {
      x.conservativeResize(t.column.rows(), x.cols() + t.column.cols());
      x.rightCols(t.column.cols()) = t.column;
    }
    if (t.taken.size()) y -= t.taken;
  }
}

Remainder beyond(const Search &search, const std::vector<Family> &families, const std::vector<Member> &members) {
  const Equation &e = search.equation();
  Remainder out;
  Eigen::MatrixXd x = e.base;
  Eigen::VectorXd y = e.y;
  add_members(search, members, x, y);
  const int fixed = int(x.cols());
  std::vector<std::vector<int>> columns;
  int at = fixed;
  for (const Family &f : families) {
    columns.emplace_back();
    for (int k = 0; k < int(f.column.cols()); ++k) columns.back().push_back(at++);
  }
  Eigen::MatrixXd all(Eigen::Index(e.rows), at);
  all.leftCols(fixed) = x;
  for (std::size_t f = 0; f < families.size(); ++f)
    if (families[f].column.cols()) all.middleCols(columns[f].front(), families[f].column.cols()) = families[f].column;
  const Eigen::MatrixXd z = whiten(e, all);
  const Eigen::VectorXd target = whiten(e, y);
  BlockGram gram(e, z, target);
  std::vector<int> now;
  std::vector<double> ridge;
  for (int k = 0; k < fixed; ++k) now.push_back(k), ridge.push_back(0);
  BlockGram::Score start = gram.cross_validate(now, ridge), current = start;
  const double n = search.rows();
  for (int step = 0; step < 5; ++step) {
    double best_worth = 8;
    int best = -1;
    BlockGram::Score best_score;
    double best_ridge = 0;
    for (std::size_t f = 0; f < families.size(); ++f) {
      if (std::find(out.family.begin(), out.family.end(), int(f)) != out.family.end() || columns[f].empty()) continue;
      for (double r : {1e-4, 1e-2, 0.3}) {
        std::vector<int> c = now;
        std::vector<double> rr = ridge;
        for (int k : columns[f]) c.push_back(k), rr.push_back(r);
        BlockGram::Score s = gram.cross_validate(c, rr);
        double worth = 0.5 * n * std::log(current.total / std::max(s.total, 1e-300)) - 2;
        const std::string &name = families[f].name;   // made of the target itself: its noise is in them too
        const bool made_of_drive = name == "drive" || name == "drive_speed" || name == "drive_position";
        if (made_of_drive && (s.total > 0.95 * current.total || !less_under_drive(e, z, target, gram, now, ridge, c, rr))) continue;
        if (worth > best_worth) best_worth = worth, best = int(f), best_score = s, best_ridge = r;
      }
    }
    if (best < 0) break;
    out.family.push_back(best);
    out.family_gain.push_back(best_worth);
    for (int k : columns[std::size_t(best)]) now.push_back(k), ridge.push_back(best_ridge);
    current = best_score;
  }
  out.sse = current.total;
  out.gain = 0.5 * n * std::log(start.total / std::max(current.total, 1e-300)) - 2 * double(out.family.size());
  out.evidence = evidence(start.sse, current.sse);
  out.broad = broad(start.sse, current.sse);
  return out;
}

// Does a family that no effect of the catalogue is like do better in this effect's place?
void ask_outside(const Search &search, const std::vector<Family> &families, const std::vector<Member> &others, const BlockGram::Score &with, Found &f) {
  static const char *const dry[] = {"coulomb", "stribeck", "lugre", "hysteresis", "asymmetric_friction", "quadratic_drag"};
  const Equation &e = search.equation();
  const BlockGram::Score without = search.solve(others).score;
  Eigen::MatrixXd x = e.base;
  Eigen::VectorXd y = e.y;
  add_members(search, others, x, y);
  const int fixed = int(x.cols());
  for (const Family &g : families) {
    const bool of_speed = g.name == "speed" && !e.electrical && std::any_of(std::begin(dry), std::end(dry), [&](const char *n) { return f.name == n; });
    const bool outside = g.catalogue.empty() && !e.electrical && g.name != "order_speed";
    if (!of_speed && !outside) continue;
    Eigen::MatrixXd all(x.rows(), fixed + g.column.cols());
    all << x, g.column;
    BlockGram gram(e, whiten(e, all), whiten(e, y));
    std::vector<int> column;
    for (int k = 0; k < int(all.cols()); ++k) column.push_back(k);
    for (double r : {1e-4, 1e-2}) {
      std::vector<double> ridge(column.size(), r);
      std::fill(ridge.begin(), ridge.begin() + fixed, 0.0);
      const BlockGram::Score s = gram.cross_validate(column, ridge);
      const double behind = (with.total - s.total) / std::max(1e-300, without.total - s.total);
      if (s.total >= without.total || behind <= f.behind) continue;
      f.behind = behind;
      f.behind_evidence = evidence(with.sse, s.sse);
      f.rival = g.name;
    }
  }
}

// Speed and voltage are not sampled at the very same instant: the speed's share of the voltage may lie early or late.
void add_skew(Equation &e) {
  const bool from_speed = !e.tracks[0].speed_raw.empty();
  e.base.conservativeResize(Eigen::Index(e.rows), e.base.cols() + 1);
  e.base.col(e.base.cols() - 1) = stack(e, [from_speed](const Track &t, std::vector<double> &f) { f = from_speed ? t.speed_raw : t.position; }, from_speed ? 1 : 2);
  e.base_column.push_back({"", false, 0});
}

Structure structure_of(const Equation &e, const Eigen::VectorXd &residual) {
  std::vector<double> none(e.block_held_out.size(), 0.0), product(e.block_held_out.size(), 0.0);
  double pairs = 0, sum = 0, square = 0, count = 0;
  for (const Track &t : e.tracks) {
    if (t.row.size() < 2) continue;
    const int step = std::max(1, t.row[1] - t.row[0]), lag = (2 * t.kernel.half + 1) / step + 1;
    for (std::size_t r = 0; r < t.row.size(); ++r) {
      const double a = residual[Eigen::Index(t.first + r)];
      square += a * a;
      count += 1;
      if (r + std::size_t(lag) >= t.row.size() || t.run[r + std::size_t(lag)] != t.run[r]) continue;
      const double ab = a * residual[Eigen::Index(t.first + r) + lag];
      sum += ab;
      pairs += 1;
      product[std::size_t(e.block[t.first + r])] -= ab;
    }
  }
  Structure s;
  if (pairs < 20 || !(square > 0)) return s;
  s.share = (sum / pairs) / (square / count);
  s.power = std::max(0.0, s.share) * square;
  s.evidence = evidence(none, product);
  return s;
}

// What the record asks for beyond the kept members: strongest first, earlier choices asked again after each.
void look(Analysis &a, const std::vector<Member> &kept, const Settings &settings, double &from, double &to) {
  Search &search = *a.search;
  a.steps.clear();
  std::erase_if(a.families, [](const Family &f) { return f.name == "order_speed"; });
  a.before = search.solve(kept);
  a.offered = search.offer(kept);
  for (const Option &o : a.offered)
    if (o.possible && o.gain > 10 && search.candidates()[std::size_t(o.candidate)].name == "cogging") a.families.push_back(order_family(search.equation(), o.shape[0]));
  a.general = beyond(search, a.families, kept);
  a.chosen = kept;
  std::vector<Option> options = a.offered;
  for (int depth = 0; depth < settings.most_effects && !search.cancelled(); ++depth) {
    if (!a.steps.empty())   // after a first effect, a further one must carry a part of the whole to be believed; more where it also filters noise
      for (Option &o : options) {
        if (!o.possible) continue;
        const std::string &name = search.candidates()[std::size_t(o.candidate)].name;
        const bool filters = name == "compliance" || name == "backlash" || name == "dead_zone" || name == "delay";
        const double now = o.total / std::max(1e-9, 1 - o.relative), gone = a.before.score.total - o.total;
        if (now - o.total < (filters ? 0.1 : kFurtherMin) * gone) o.possible = false;
      }
    auto index_of = [&](const char *name) {
      for (std::size_t c = 0; c < search.candidates().size(); ++c)
        if (search.candidates()[c].name == name) return int(c);
      return -1;
    };
    const int dry = index_of("coulomb"), load = index_of("constant_load"), asymmetric = index_of("asymmetric_friction");
    auto has = [&](int c) { return std::any_of(a.chosen.begin(), a.chosen.end(), [&](const Member &m) { return m.candidate == c; }); };
    if (asymmetric >= 0 && has(dry) && has(load) && search.solve(a.chosen).score.total - options[std::size_t(asymmetric)].total < 0.1 * (a.before.score.total - options[std::size_t(asymmetric)].total))
      options[std::size_t(asymmetric)].possible = false;
    int best = pick(search, options);
    if (best < 0) break;
    if (best == asymmetric && dry >= 0 && load >= 0 && !has(dry) && !has(load)) {
      // A small difference of levels is as well a load beside symmetric friction, which is the commoner machine.
      std::vector<Member> pair = a.chosen;
      pair.push_back({dry, {}, false});
      pair.push_back({load, {}, false});
      Solution s = search.solve(pair);
      const double gone = search.solve(a.chosen).score.total - options[std::size_t(best)].total, same = search.solve(a.chosen).score.total - s.score.total;
      const Eigen::Index last = s.coefficient.size() - 1;
      if (same > 0.9 * gone && s.coefficient[last - 1] > 0 && std::fabs(s.coefficient[last]) < 0.25 * s.coefficient[last - 1]) {
        a.chosen = pair;
        a.steps.push_back(a.chosen);
        options = search.offer(a.chosen);
        continue;
      }
    }
    a.chosen = search.joined(a.chosen, options[std::size_t(best)].candidate, options[std::size_t(best)].shape);
    search.polish(a.chosen);
    from = to;
    to = from + 0.5 * (0.95 - from);
    for (int again = 0; again < 1 && !a.steps.empty(); ++again)
      if (!reexamine(search, a.chosen, kept)) break;
    a.steps.push_back(a.chosen);
    options = search.offer(a.chosen);
  }
  simplify_asymmetry(search, a.chosen);
}

// The accepted effects once more, with rows counted by how sure they are where the motion turns round and the drive jumps. Those that lived on unsure
// rows are dropped; false, with the rows weighed so, where none is left.
bool confirmed(Analysis &a, const std::vector<Member> &kept) {
  Search &search = *a.search;
  if (a.chosen.size() == kept.size() && a.steps.empty()) return true;
  const std::vector<double> plain = search.equation().weight;
  if (!weigh_by_kind(search, search.solve(a.chosen).residual)) return true;
  std::vector<Member> sure;
  bool any = false;
  for (std::size_t m = 0; m < a.chosen.size(); ++m) {
    const bool stays = a.chosen[m].kept || acceptable(search, search.refine(a.chosen[m].candidate, without(a.chosen, m, kept), a.chosen[m].shape));
    if (stays) sure.push_back(a.chosen[m]);
    any |= stays && !a.chosen[m].kept;
  }
  if (!any) return false;
  search.weigh(plain);
  if (sure.size() == a.chosen.size()) return true;
  for (const Member &k : kept)   // what a dropped effect took the place of stands again
    if (std::none_of(sure.begin(), sure.end(), [&](const Member &m) { return m.candidate == k.candidate || subsumes(search.candidates()[std::size_t(m.candidate)], search.candidates()[std::size_t(k.candidate)]); })) sure.push_back(k);
  if (search.sound(sure)) a.chosen = sure, a.steps.push_back(sure);
  return true;
}

Analysis analyse(Equation equation, const driveid_model &model, const Settings &settings, std::vector<Notice> &notices) {
  Analysis a;
  if (equation.electrical && !equation.tracks.empty() && !equation.tracks[0].position.empty()) add_skew(equation);
  a.families = make_families(equation);
  a.floor = find_floor(equation, a.families);
  std::vector<Candidate> candidates = make_candidates(equation);
  // Voltage and current are read in one inverter; the dead time of its command shows in the motion.
  if (equation.electrical)
    std::erase_if(candidates, [](const Candidate &c) { return c.name == "delay"; });
  if (!settings.effects.empty())
    std::erase_if(candidates, [&](const Candidate &c) { return std::find(settings.effects.begin(), settings.effects.end(), c.name) == settings.effects.end(); });
  // effects that the user's model already has
  std::vector<std::pair<int, const driveid_effect_use *>> present;
  for (unsigned k = 0; k < model.effects; ++k) {
    const driveid_effect_use &use = model.effect[k];
    int index = -1;
    for (std::size_t c = 0; c < candidates.size(); ++c)
      if (candidates[c].name == use.name) index = int(c);
    if (index < 0 && use.formula[0]) {
      bool electrical = !std::strcmp(use.adds_to, "v_V");
      if (electrical != equation.electrical) continue;
      std::string error;
      Candidate own = own_candidate(use, error);
      if (!error.empty()) {
        notices.push_back({"formula", std::string(use.name) + ": " + error, ""});
        continue;
      }
      candidates.push_back(own);
      index = int(candidates.size()) - 1;
    }
    if (index >= 0) present.push_back({index, &use});
  }
  a.search = std::make_unique<Search>(std::move(equation), std::move(candidates), settings.threads);
  Search &search = *a.search;
  double from = 0, to = 0.35;
  search.set_progress([&](double d) { return settings.tick ? settings.tick(from + (to - from) * d) : true; });

  std::vector<Member> kept;
  for (auto &[index, use] : present) {
    const Candidate &c = search.candidates()[std::size_t(index)];
    Member m{index, {}, true};
    std::vector<double> published;
    bool set = true;
    for (unsigned p = 0; p < use->params; ++p) published.push_back(use->param[p].value), set &= use->param[p].state != DRIVEID_PARAM_UNSET;
    if (c.axis.empty()) kept.push_back(m);
    else if (set && c.info && published.size() >= c.info->params) {
      m.shape = shape_of(search.equation(), c, published);
      Option o = search.refine(index, kept, m.shape);
      if (o.possible) m.shape = o.shape;
      kept.push_back(m);
    } else {
      std::vector<Option> options = search.offer(kept);
      if (options[std::size_t(index)].possible) m.shape = options[std::size_t(index)].shape, kept.push_back(m);
      else if (!c.axis.empty()) {
        for (const ShapeAxis &x : c.axis) m.shape.push_back(x.grid[x.grid.size() / 2]);
        kept.push_back(m);
      }
    }
  }
  look(a, kept, settings, from, to);
  if (!confirmed(a, kept)) look(a, kept, settings, from, to);
  a.after = search.solve(a.chosen);
  a.remainder = beyond(search, a.families, a.chosen);
  const double floor_sse = std::min({a.general.sse, a.remainder.sse, a.after.score.total});
  a.removable = std::max(0.0, a.before.score.total - floor_sse);
  a.explained = a.removable > 0 ? (a.before.score.total - a.after.score.total) / a.removable : 0;

  // Accepted effects, each with its rivals for the same place.
  const double n = search.rows();
  for (std::size_t m = 0; m < a.chosen.size(); ++m) {
    if (a.chosen[m].kept) continue;
    const Candidate &c = search.candidates()[std::size_t(a.chosen[m].candidate)];
    Found *found = nullptr;
    for (Found &f : a.found)
      if (f.name == c.name) found = &f;
    if (found) {
      found->member.push_back(m);
      continue;
    }
    Found f;
    f.name = c.name;
    f.member.push_back(m);
    std::vector<Member> others = without(a.chosen, m, kept);
    bool alone = std::all_of(others.begin(), others.end(), [](const Member &o) { return o.kept; });
    std::vector<Option> rivals = alone ? a.offered : search.offer(others);
    double total_without = search.solve(others).score.total, total_with = a.after.score.total;
    f.share = a.removable > 0 ? (total_without - total_with) / a.removable : 0;
    f.worth = 0.5 * n * std::log(total_without / std::max(total_with, 1e-300));
    f.margin = f.worth;
    for (const Option &o : rivals) {
      if (!o.possible || o.candidate == a.chosen[m].candidate) continue;
      double behind = 0.5 * n * std::log(o.total / std::max(total_with, 1e-300));
      const Candidate &rival = search.candidates()[std::size_t(o.candidate)];
      if (subsumes(rival, c)) continue;
      bool close = behind < 5 && behind < 0.1 * f.worth && std::sqrt(o.total / total_with) < 1.05 && o.held_gain > 0;
      if (close && acceptable(search, o)) f.ties.push_back({o.candidate, o.shape, o.total, rival.name});
      else f.margin = std::min(f.margin, behind);
    }
    std::sort(f.ties.begin(), f.ties.end(), [](const Tie &x, const Tie &y) { return x.total < y.total; });
    ask_outside(search, a.families, others, a.after.score, f);
    a.found.push_back(std::move(f));
  }
  std::sort(a.found.begin(), a.found.end(), [](const Found &x, const Found &y) { return x.share > y.share; });
  double left = a.removable > 0 ? (a.after.score.total - floor_sse) / a.removable : 0;
  // Noise of the current on both sides of a voltage equation looks like a curved resistance: more is asked there.
  const bool electrical = search.equation().electrical;
  bool more = a.remainder.gain > 40 && (a.remainder.evidence > 3 || (a.remainder.evidence > 1.5 && a.remainder.broad > kBroadMin && a.remainder.broad * a.remainder.gain > kBroadGain)) && (a.after.score.total - a.remainder.sse) / a.after.score.total > (electrical ? 0.2 : 0.03);
  a.regular_before = structure_of(search.equation(), a.before.residual);
  a.regular_after = structure_of(search.equation(), a.after.residual);
  const bool regular = a.regular_after.share > 0.4 && a.regular_after.evidence > 4 && a.regular_after.power > 0.35 * a.regular_before.power;
  a.unknown_worth = std::max(a.remainder.gain, regular ? 0.5 * n * a.regular_after.share : 0.0);
  // What is left in the very coordinates of an accepted effect is sooner its idealisation than something else.
  // A wave whose size varies with speed contradicts cogging, which has one size.
  bool same = false, contradicted = false;
  if (!a.remainder.family.empty())
    for (const std::string &name : a.families[std::size_t(a.remainder.family[0])].catalogue)
      for (const Found &f : a.found) same |= f.name == name;
  if (!a.remainder.family.empty() && a.families[std::size_t(a.remainder.family[0])].name == "order_speed")
    for (const Found &f : a.found) contradicted |= f.name == "cogging";
  bool outdone = false;
  if (!a.found.empty()) {
    const Found &f = a.found.front();
    outdone = f.behind_evidence > kBehindEvidence && f.behind > (f.rival == "speed" ? kBehindSpeed : f.name == "encoder_eccentricity" ? kBehindExact : kBehind);
    if (outdone) a.unknown_worth = std::max(a.unknown_worth, f.worth), a.outdone_by = f.rival;
  }
  a.unknown = outdone || (more && (a.found.empty() || left > (contradicted ? 0.15 : same ? 0.5 : 0.35))) || regular;
  if (settings.tick) settings.tick(1.0);
  return a;
}

}  // namespace driveid::diagnose
