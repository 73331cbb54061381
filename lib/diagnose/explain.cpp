// SPDX-License-Identifier: Apache-2.0
#include "diagnose/confidence.hpp"
#include "diagnose/explain.hpp"
#include "diagnose/explain_refine.hpp"
#include "diagnose/plausible.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>

namespace driveid::diagnose {
namespace {

using nlohmann::ordered_json;

// Published parameters of a member with 95 % intervals by the delta method.
std::vector<Value> values_of(const Search &search, const Solution &solution, std::size_t m, const Eigen::MatrixXd &covariance) {
  const Equation &e = search.equation();
  const Candidate &c = search.candidates()[std::size_t(solution.member[m].candidate)];
  Eigen::Index linear_at = e.base.cols(), shape_at = 0;
  for (std::size_t k = 0; k < solution.member.size(); ++k) {
    if (k < m) linear_at += solution.linear[k].size();
    shape_at += solution.linear[k].size();
  }
  shape_at += e.base.cols();
  for (std::size_t k = 0; k < m; ++k) shape_at += Eigen::Index(search.candidates()[std::size_t(solution.member[k].candidate)].axis.size());
  const Eigen::VectorXd &linear = solution.linear[m];
  const std::vector<double> &shape = solution.member[m].shape;
  const Term term = realise(e, c, shape, search.nominal());
  auto physical = [&](const Eigen::VectorXd &l) { return term.drive_part.size() ? Eigen::VectorXd(l / drive_factor(term, l)) : l; };
  std::vector<double> p = publish(e, c, shape, physical(linear));
  const Eigen::Index nl = linear.size(), ns = Eigen::Index(shape.size());
  Eigen::MatrixXd g(Eigen::Index(p.size()), nl + ns), block(nl + ns, nl + ns);
  std::vector<Eigen::Index> index;
  for (Eigen::Index k = 0; k < nl; ++k) index.push_back(linear_at + k);
  for (Eigen::Index k = 0; k < ns; ++k) index.push_back(shape_at + k);
  for (Eigen::Index a = 0; a < nl + ns; ++a)
    for (Eigen::Index b = 0; b < nl + ns; ++b) block(a, b) = covariance(index[std::size_t(a)], index[std::size_t(b)]);
  for (Eigen::Index k = 0; k < nl + ns; ++k) {
    Eigen::VectorXd l = linear;
    std::vector<double> s = shape;
    double sd = std::sqrt(std::max(0.0, block(k, k)));
    double step = k < nl ? 0.05 * std::max(sd, 1e-6 * std::fabs(l[k]) + 1e-300) : 0.05 * std::max(std::min(sd, 0.5 * std::fabs(s[std::size_t(k - nl)]) + 1e-300), 1e-6 * std::fabs(s[std::size_t(k - nl)]) + 1e-300);
    if (k < nl) l[k] += step;
    else s[std::size_t(k - nl)] += step;
    std::vector<double> q = publish(e, c, s, physical(l));
    for (std::size_t i = 0; i < p.size(); ++i) g(Eigen::Index(i), k) = (q[i] - p[i]) / step;
  }
  Eigen::MatrixXd v = g * block * g.transpose();
  std::vector<Value> out;
  driveid_formula formula;
  char message[64];
  if (!c.info) driveid_formula_parse(c.formula.c_str(), &formula, message, sizeof message);
  for (std::size_t i = 0; i < p.size(); ++i) {
    char name[DRIVEID_NAME_SIZE] = "", unit[24] = "";
    if (c.info) {
      driveid_effect_param_name(c.info, std::uint32_t(i), e.frame, e.drive_unit, name, sizeof name);
      driveid_effect_param_unit(c.info, std::uint32_t(i), e.frame, e.drive_unit, unit, sizeof unit);
    } else {
      std::size_t seen = 0;
      for (std::uint32_t k = 0; k < formula.params; ++k)
        if ((formula.linear_mask >> k & 1) && seen++ == i) std::snprintf(name, sizeof name, "%s", formula.param[k]);
    }
    double half = 1.96 * std::sqrt(std::max(0.0, v(Eigen::Index(i), Eigen::Index(i))));
    out.push_back({name, unit, p[i], p[i] - half, p[i] + half});
  }
  return out;
}

void set_value(driveid_param &p, const Value &v) {
  p.value = v.value;
  p.lo = v.lo;
  p.hi = v.hi;
  if (p.state == DRIVEID_PARAM_UNSET) p.state = DRIVEID_PARAM_FREE;
}

void set_nominal(driveid_model &model, const Analysis &a, const Solution &s, std::vector<Notice> &notices, bool alarms) {
  const Equation &e = a.search->equation();
  Eigen::MatrixXd covariance = a.search->covariance(s);
  double factor = 1;
  for (std::size_t m = 0; m < s.member.size(); ++m) {
    Term t = realise(e, a.search->candidates()[std::size_t(s.member[m].candidate)], s.member[m].shape, a.search->nominal());
    factor += drive_factor(t, s.linear[m]) - 1;
  }
  Eigen::Index column = 0;
  for (const BaseColumn &b : e.base_column) {
    if (b.given) continue;
    double value = s.coefficient[column] / factor, half = 1.96 * std::sqrt(std::max(0.0, covariance(column, column))) / factor;
    ++column;
    for (unsigned k = 0; k < model.params; ++k)
      if (b.name == model.param[k].name) {
        bool was_free = model.param[k].state == DRIVEID_PARAM_FREE;
        double before = model.param[k].value;
        set_value(model.param[k], {b.name, "", value, value - half, value + half});
        if (alarms && value + half < 0)
          notices.push_back({"absorption", b.name + " comes out negative: it stands in for something that the model lacks (or a column has the wrong sign)", ""});
        else if (alarms && was_free && before != 0 && (value / before > 1.3 || value / before < 0.77) && std::fabs(value - before) > 3 * half)
          notices.push_back({"absorption", b.name + " is far from the model's value once missing effects are looked for: it stood in for something", ""});
      }
  }
}

bool has_values(const driveid_model &model, const Equation &e) {
  for (const BaseColumn &b : e.base_column)
    if (const driveid_param *p = b.given ? nullptr : driveid_model_param(&model, b.name.c_str()); p && p->state == DRIVEID_PARAM_UNSET) return false;
  return true;
}

void take_nominal(driveid_model &model, const driveid_model &from, const Equation &e) {
  for (const BaseColumn &b : e.base_column)
    for (unsigned k = 0; k < model.params; ++k)
      if (b.name == model.param[k].name) model.param[k] = from.param[k];
}

driveid_frame frame_of(const std::vector<Analysis> &analysis) {
  for (const Analysis &a : analysis)
    if (!a.search->equation().electrical) return a.search->equation().frame;
  return DRIVEID_FRAME_TORQUE;
}

// Residual over the coordinates in which the strongest general family is regular.
ordered_json shape_table(const Analysis &a) {
  static const Family over_time{"time", {"t_s"}, {}, {}};   // regular in no coordinate of the motion
  const auto rival = std::find_if(a.families.begin(), a.families.end(), [&](const Family &family) { return !a.outdone_by.empty() && family.name == a.outdone_by; });
  const Family &f = rival != a.families.end() ? *rival : a.remainder.family.empty() ? over_time : a.families[std::size_t(a.remainder.family[0])];
  const Equation &e = a.search->equation();
  auto value = [&](const std::string &coordinate, const driveid_effect_state &s) {
    if (coordinate == "omega_rad_s" || coordinate == "v_m_s") return s.speed;
    if (coordinate == "theta_rad" || coordinate == "x_m") return s.angle;
    if (coordinate == "acceleration") return s.accel;
    if (coordinate == "direction") return s.speed > 0 ? 1.0 : -1.0;
    if (coordinate == "t_s") return s.t_s;
    if (coordinate == "T_degC") return s.T_degC;
    if (coordinate == "i_A" && e.electrical) return s.current_A;
    return s.drive;
  };
  ordered_json out = {{"family", f.name}, {"coordinates", f.coordinates}, {"unit", e.unit}, {"what", "mean of the remaining error of the " + e.signal + " equation"}};
  std::vector<std::vector<double>> edges;
  const std::size_t dims = std::min<std::size_t>(2, f.coordinates.size()), bins = dims == 1 ? 24 : 10;
  std::vector<const driveid_effect_state *> rows;
  for (const Track &t : e.tracks)
    for (int c : t.row) rows.push_back(&t.state[std::size_t(c)]);
  for (std::size_t d = 0; d < dims; ++d) {
    std::vector<double> v;
    for (const auto *s : rows) v.push_back(value(f.coordinates[d], *s));
    std::sort(v.begin(), v.end());
    std::vector<double> edge;
    for (std::size_t b = 0; b <= bins; ++b) {
      double q = double(b) / double(bins), x = 0.5 * v[std::size_t(q * double(v.size() - 1))] + 0.5 * (v.front() + q * (v.back() - v.front()));
      if (edge.empty() || x > edge.back()) edge.push_back(x);
    }
    if (edge.size() < 2) edge = {v.front(), v.front() + 1};
    edges.push_back(edge);
  }
  auto bin = [](const std::vector<double> &edge, double x) { return std::size_t(std::clamp<std::ptrdiff_t>(std::upper_bound(edge.begin(), edge.end(), x) - edge.begin() - 1, 0, std::ptrdiff_t(edge.size()) - 2)); };
  const std::size_t n0 = edges[0].size() - 1, n1 = dims > 1 ? edges[1].size() - 1 : 1;
  std::vector<double> sum(n0 * n1, 0), square(n0 * n1, 0), count(n0 * n1, 0);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    std::size_t i = bin(edges[0], value(f.coordinates[0], *rows[k])), j = dims > 1 ? bin(edges[1], value(f.coordinates[1], *rows[k])) : 0, c = i * n1 + j;
    double r = a.after.residual[Eigen::Index(k)];
    sum[c] += r;
    square[c] += r * r;
    count[c] += 1;
  }
  ordered_json table = ordered_json::array();
  for (std::size_t i = 0; i < n0; ++i)
    for (std::size_t j = 0; j < n1; ++j) {
      std::size_t c = i * n1 + j;
      if (count[c] < 5) continue;
      double mean = sum[c] / count[c], sd = std::sqrt(std::max(0.0, square[c] / count[c] - mean * mean));
      ordered_json line = ordered_json::object();
      line[f.coordinates[0]] = 0.5 * (edges[0][i] + edges[0][i + 1]);
      if (dims > 1) line[f.coordinates[1]] = 0.5 * (edges[1][j] + edges[1][j + 1]);
      line["error"] = mean;
      line["deviation"] = sd;
      line["rows"] = count[c];
      table.push_back(line);
    }
  out["table"] = table;
  return out;
}

void structural_ties(const Explanation &x, Ranked &r) {
  // A constant in the torque equation is a load or an offset of the current reading unless a voltage equation speaks too.
  bool voltage = false, ampere = false;
  for (const Analysis &a : x.analysis) voltage |= a.search->equation().electrical, ampere |= !a.search->equation().electrical && a.search->equation().drive_unit == 'A';
  auto add = [&](const char *name) {
    if (r.effect != name && std::find(r.ties.begin(), r.ties.end(), name) == r.ties.end()) r.ties.push_back(name);
  };
  if (!voltage && ampere && r.effect == "constant_load") add("current_offset");
  if (!voltage && ampere && r.effect == "current_offset") add("constant_load");
}

}  // namespace

Options options_of(const char *json) {
  Options o;
  if (!json || !*json) return o;
  ordered_json j = ordered_json::parse(json, nullptr, false);
  if (!j.is_object()) return o;
  if (j.contains("threads") && j["threads"].is_number_integer()) o.threads = std::clamp(j["threads"].get<int>(), 1, 16);
  if (j.contains("seed") && j["seed"].is_number_integer()) o.seed = j["seed"].get<unsigned>();
  if (j.contains("errors") && j["errors"].is_boolean()) o.errors = j["errors"].get<bool>();
  if (j.contains("effects") && j["effects"].is_array())
    for (auto &e : j["effects"])
      if (e.is_string()) o.effects.push_back(e.get<std::string>());
  return o;
}

Explanation explain(const driveid_model &model, const driveid_task &task, const Options &options) {
  Explanation x;
  x.model = x.grown = model;
  auto step = [&](double done, const char *what) {
    if (task.progress && task.progress(task.progress_context, done, what)) x.cancelled = true;
    return !x.cancelled;
  };
  step(0.0, "reading the records");
  for (std::size_t k = 0; k < task.trainings; ++k) x.training.push_back(prepare(task.training[k], model));
  for (std::size_t k = 0; k < task.held_outs; ++k) x.held_out.push_back(prepare(task.held_out[k], model));
  for (auto *list : {&x.training, &x.held_out})
    for (Prepared &p : *list) x.notices.insert(x.notices.end(), p.notices.begin(), p.notices.end());
  EquationSet set = make_equations(model, x.training, x.held_out);
  x.notices.insert(x.notices.end(), set.notices.begin(), set.notices.end());
  for (auto *list : {&x.training, &x.held_out})   // one by one: a wrong unit in one record is lost among the others
    for (const Prepared &p : *list)
      for (Notice &n : implausible(make_equations(model, {p}, {}), model, p.name)) x.notices.push_back(std::move(n));
  if (set.bad.empty()) set.bad = opposed(set, x.training, x.held_out);
  if (!set.bad.empty() || set.equation.empty()) {
    x.verdict = "bad_data";
    x.message = set.bad.empty() ? "the record has no equation of this structure: record its input and its motion" : set.bad;
    return x;
  }
  if (task.held_outs == 0) x.notices.push_back({"held_out", "no held-out record was given: every third of ten contiguous blocks of the training record was set aside", ""});
  const double equations = double(set.equation.size());
  double done = 0;
  for (Equation &e : set.equation) {
    Settings s;
    s.threads = options.threads;
    s.effects = options.effects;
    std::string what = "searching the catalogue in the " + e.signal + " equation";
    s.tick = [&](double d) { return step(0.02 + 0.9 * (done + d) / equations, what.c_str()); };
    x.analysis.push_back(analyse(std::move(e), model, s, x.notices));
    done += 1;
    if (x.cancelled) return x;
  }
  char reason[200];
  driveid_frame frame = frame_of(x.analysis);
  driveid_model_set_frame(&x.model, frame, reason, sizeof reason);
  x.grown = x.model;
  bool unknown = false;
  double unknown_gain = 0, found_worth = 0;
  for (Analysis &a : x.analysis) {
    driveid_model balanced = x.model;   // values of the balance tell of absorption; a fit's own values simulate better and stay where nothing is added
    set_nominal(balanced, a, a.before, x.notices, true);
    const bool fitted = has_values(x.model, a.search->equation());
    if (!fitted) take_nominal(x.model, balanced, a.search->equation());
    if (!fitted || !a.found.empty()) set_nominal(x.grown, a, a.after, x.notices, false);
    const Eigen::MatrixXd covariance = a.search->covariance(a.after);
    for (Found &f : a.found) {
      Ranked r;
      r.effect = f.name;
      r.accepted = true;
      r.share = std::clamp(f.share, 0.0, 1.0);
      r.worth = f.worth;
      r.lead = f.margin;
      r.beyond = f.behind;
      r.family = f.rival;
      r.confidence = confidence(f.margin, f.worth, a.explained);   // of a tie: that one of its members is right
      for (std::size_t k = 0; k < f.member.size(); ++k) {
        std::vector<Value> v = values_of(*a.search, a.after, f.member[k], covariance);
        const Candidate &c = a.search->candidates()[std::size_t(a.chosen[f.member[k]].candidate)];
        if (add_in_place(x.grown, c.name.c_str(), reason, sizeof reason) == DRIVEID_OK) {
          x.added++;
          driveid_effect_use &use = x.grown.effect[x.grown.effects - 1];
          for (unsigned p = 0; p < use.params; ++p)
            for (const Value &value : v)
              if (value.name == use.param[p].name) set_value(use.param[p], value);
        }
        for (Value value : v) {
          if (k) value.name += "_" + std::to_string(k + 1);
          r.parameters.push_back(value);
        }
      }
      for (const Tie &t : f.ties) r.ties.push_back(t.name);
      structural_ties(x, r);
      found_worth = std::max(found_worth, f.worth);
      bool merged = false;
      for (Ranked &other : x.ranked)
        if (other.effect == r.effect) {
          merged = true;
          if (r.worth > other.worth) std::swap(r, other);
        }
      if (!merged) x.ranked.push_back(std::move(r));
    }
    if (a.unknown && a.unknown_worth > unknown_gain) {
      unknown = true;
      unknown_gain = a.unknown_worth;
      x.shape = shape_table(a);
    }
  }
  if (!x.ranked.empty() && step(0.93, "refining the values")) {
    refine_ranked(x);
    widen_for_choice(x);
  }
  std::stable_sort(x.ranked.begin(), x.ranked.end(), [](const Ranked &p, const Ranked &q) { return p.worth > q.worth; });
  if (x.ranked.empty()) x.verdict = unknown ? "unknown" : "nothing_missing";
  else if (unknown && unknown_gain > 0.3 * found_worth) x.verdict = "unknown";
  else x.verdict = x.ranked[0].ties.empty() ? "missing" : "cannot_tell";
  if (x.verdict != "nothing_missing") {   // the refused, best first
    std::vector<Ranked> refused;
    for (Analysis &a : x.analysis)
      for (const Option &o : a.offered) {
        if (!o.possible) continue;
        const Candidate &c = a.search->candidates()[std::size_t(o.candidate)];
        bool known = false;
        for (const Ranked &r : x.ranked) known |= r.effect == c.name || std::find(r.ties.begin(), r.ties.end(), c.name) != r.ties.end();
        for (const Ranked &r : refused) known |= r.effect == c.name;
        if (known || o.worth() < 3) continue;
        Ranked r;
        r.effect = c.name;
        r.share = a.removable > 0 ? std::clamp((a.before.score.total - o.total) / a.removable, 0.0, 1.0) : 0;
        r.worth = o.worth();
        r.why = o.held_gain <= 0 ? "it lowers the training error only" : "what it explains is explained better by what was accepted";
        refused.push_back(r);
      }
    std::sort(refused.begin(), refused.end(), [](const Ranked &p, const Ranked &q) { return p.worth > q.worth; });
    if (refused.size() > 6) refused.resize(6);
    x.ranked.insert(x.ranked.end(), refused.begin(), refused.end());
  }
  return x;
}

}  // namespace driveid::diagnose
