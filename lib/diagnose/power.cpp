// SPDX-License-Identifier: Apache-2.0
// Detection power on the user's own record: what would have been found?
//
// The fitted model's equation keeps its own noise; to it the residual of one effect is added at a growing size, as the effect would have made
// the drive work against it, and the search of explain looks for it. The smallest size that is accepted is first located by the search's own test
// of that effect alone, then confirmed by the whole question (the effect, what it is confused with, what the model has): right name first, or tied.
#include <algorithm>
#include <cmath>

#include <driveid/diagnose.h>

#include "diagnose/compare_core.hpp"
#include "diagnose/explain_core.hpp"
#include "diagnose/fit_task.hpp"

namespace driveid::diagnose {
namespace {

using nlohmann::ordered_json;

constexpr double kWorth = 12;      // as explain: log-likelihood beyond its cost
constexpr int kSteps = 7;          // halvings of the logarithmic range

struct Injection {
  Eigen::VectorXd force;           // raw rows, added to the target
  std::vector<double> published;   // parameters of that size
};

double largest(const Equation &e, double (*of)(const driveid_effect_state &)) {
  double most = 0;
  for (const Track &t : e.tracks)
    for (const driveid_effect_state &s : t.state) most = std::max(most, std::fabs(of(s)));
  return most;
}

std::vector<double> middle_shape(const Candidate &c) {
  std::vector<double> shape;
  for (const ShapeAxis &a : c.axis) shape.push_back(a.grid.empty() ? 0.5 * (a.lo + a.hi) : a.grid[a.grid.size() / 2]);
  return shape;
}

// The effect at a size between 0 and 1: 1 is far beyond anything that could be overlooked.
Injection inject(const Equation &e, const Candidate &c, const Nominal &nominal, double size) {
  Injection out;
  std::vector<double> shape = middle_shape(c);
  Eigen::VectorXd linear = Eigen::VectorXd::Zero(c.columns);
  if (c.name == "delay") shape = {size * 20 * e.tracks[0].dt_s};
  else if (c.name == "dead_zone") shape = {size * 0.5 * largest(e, [](const driveid_effect_state &s) { return s.drive; })};
  else if (c.name == "backlash") shape[0] = size * 0.1 * std::max(1e-9, largest(e, [](const driveid_effect_state &s) { return s.angle; }));
  const Term t = realise(e, c, shape, nominal);
  out.force = Eigen::VectorXd::Zero(Eigen::Index(e.rows));
  if (t.taken.size()) out.force += t.taken;
  if (t.column.cols() && c.name != "dead_zone") {
    linear = Eigen::VectorXd::Zero(t.column.cols());
    linear[0] = 1;
    if (c.name == "stribeck" || c.name == "eccentric_friction") linear[1] = 0.6;
    if (c.name == "asymmetric_friction") linear[1] = 0.5;
    const double unit = std::sqrt((t.column * linear).squaredNorm() / double(e.rows)), level = std::sqrt(e.y.squaredNorm() / double(e.rows));
    if (c.name == "compliance") linear *= size * nominal.inertia * 0.9;
    else if (c.name == "backlash") linear *= 0.5 * nominal.inertia;
    else linear *= unit > 0 ? size * level / unit : 0;
    out.force += t.column * linear;
  }
  out.published = publish(e, c, shape, linear);
  return out;
}

bool found_alone(const Equation &clean, const Candidate &c, const Injection &injected, const std::vector<Candidate> &candidates, const std::vector<Member> &members, int index, int threads) {
  Equation e = clean;
  e.y += injected.force;
  Search search(e, candidates, threads);
  Option o = c.axis.empty() ? search.refine(index, members, {}) : search.refine(index, members, middle_shape(c));
  return o.possible && o.worth() > kWorth && o.held_gain > 0;
}

// The question as explain asks it, among the effect, its rivals and the model's own.
bool found_first(const Equation &clean, const driveid_model &model, const Candidate &c, const Injection &injected, int threads) {
  Equation e = clean;
  e.y += injected.force;
  Settings settings;
  settings.threads = threads;
  settings.effects = {c.name};
  for (int k = 0; c.info && k < DRIVEID_EFFECT_NAMES_MAX && c.info->confused_with[k]; k++) settings.effects.push_back(c.info->confused_with[k]);
  for (uint32_t k = 0; k < model.effects; k++) settings.effects.push_back(model.effect[k].name);
  std::vector<Notice> notices;
  const Analysis a = analyse(e, model, settings, notices);
  if (a.found.empty()) return false;
  bool named = a.found[0].name == c.name;
  for (const Tie &t : a.found[0].ties) named = named || t.name == c.name;
  return named;
}

ordered_json published_json(const Equation &e, const Candidate &c, const std::vector<double> &published) {
  ordered_json out = ordered_json::object();
  for (uint32_t k = 0; c.info && k < c.info->params && k < published.size(); k++) {
    char name[DRIVEID_NAME_SIZE], unit[24];
    driveid_effect_param_name(c.info, k, e.frame, e.drive_unit, name, sizeof name);
    driveid_effect_param_unit(c.info, k, e.frame, e.drive_unit, unit, sizeof unit);
    out[name] = {{"value", published[k]}, {"unit", unit}};
  }
  return out;
}

ordered_json smallest(const Equation &clean, const driveid_model &model, const std::vector<Candidate> &candidates, const std::vector<Member> &members, const Nominal &nominal, int index, double floor, int threads) {
  const Candidate &c = candidates[std::size_t(index)];
  ordered_json entry = {{"effect", c.name}, {"equation", clean.signal}};
  double lo = std::log(1e-5), hi = 0;
  if (!found_alone(clean, c, inject(clean, c, nominal, 1.0), candidates, members, index, threads)) {
    entry["found"] = false;
    entry["why"] = c.info ? std::string("this motion does not show it at any size; record: ") + c.info->separated_by : "this motion does not show it";
    return entry;
  }
  for (int k = 0; k < kSteps; k++) {
    const double middle = 0.5 * (lo + hi);
    (found_alone(clean, c, inject(clean, c, nominal, std::exp(middle)), candidates, members, index, threads) ? hi : lo) = middle;
  }
  for (int k = 0; k < 5; k++, hi += 0.4) {
    const Injection injected = inject(clean, c, nominal, std::exp(std::min(0.0, hi)));
    if (!found_first(clean, model, c, injected, threads)) continue;
    const double rms = std::sqrt(injected.force.squaredNorm() / double(clean.rows));
    entry["found"] = true;
    entry["smallest"] = published_json(clean, c, injected.published);
    entry["rms"] = rms;
    entry["unit"] = clean.unit;
    entry["times_floor"] = floor > 0 ? ordered_json(rms / floor) : ordered_json(nullptr);
    return entry;
  }
  entry["found"] = false;
  entry["why"] = c.info ? std::string("it would be taken for something else in this motion; record: ") + c.info->separated_by : "it would be taken for something else";
  return entry;
}

bool wanted(const Task &task, const std::string &name) {
  if (!task.options.contains("effects") || !task.options["effects"].is_array() || task.options["effects"].empty()) return true;
  for (const auto &e : task.options["effects"])
    if (e == name) return true;
  return false;
}

void power(Task &task, ordered_json &document) {
  FitOptions options;
  options.threads = task.threads;
  options.refine = false;
  const FitOutcome fitted = fit_model(task.model, task.training, {}, options);
  if (!fitted.bad.empty()) throw BadData(fitted.bad);
  EquationSet set = make_equations(fitted.model, task.training, {});
  if (!set.bad.empty()) throw BadData(set.bad);
  document["effects"] = ordered_json::array();
  std::size_t done = 0, all = 0;
  for (const Equation &e : set.equation) all += make_candidates(e).size();
  for (Equation &e : set.equation) {
    const Floor floor = find_floor(e, make_families(e));
    Equation clean = e;
    const Eigen::VectorXd residual = equation_residual(e, fitted.model);
    clean.y = e.y;
    std::vector<Notice> notices;
    Settings settings;
    settings.threads = task.threads;
    const Analysis present = analyse(clean, fitted.model, settings, notices);
    clean.y -= residual - (present.after.residual.size() == residual.size() ? present.after.residual : residual);   // what explain finds already is not to be found again
    const std::vector<Candidate> &candidates = present.search->candidates();
    std::vector<Member> members;
    for (const Member &m : present.chosen)
      if (m.kept) members.push_back(m);
    for (std::size_t k = 0; k < candidates.size(); k++, done++) {
      if (!task.tick(double(done) / double(std::max<std::size_t>(1, all)), candidates[k].name.c_str())) throw Cancelled{};
      bool in_model = false;
      for (const Member &m : members) in_model = in_model || m.candidate == int(k);
      if (in_model || !wanted(task, candidates[k].name)) continue;
      document["effects"].push_back(smallest(clean, fitted.model, candidates, members, present.search->nominal(), int(k), std::max(floor.lo, floor.hi), task.threads));
    }
    document["noise_floor"].push_back({{"equation", e.signal}, {"unit", e.unit}, {"noise_floor", {std::min(floor.lo, floor.hi), floor.hi}}});
  }
  task.tick(1.0, "done");
}

}  // namespace
}  // namespace driveid::diagnose

extern "C" driveid_status driveid_power(const driveid_task *task, char **json, char *message, size_t message_size) {
  return driveid::diagnose::answer(task, json, message, message_size, driveid::diagnose::power);
}
