// SPDX-License-Identifier: Apache-2.0
// Detection power on the user's own record: what would have been found?
//
// The fitted model's equation keeps its own noise, less what explain finds in it and with nothing regular left; to it the residual of one effect is
// added at a growing size, as the effect would have made the drive work against it, and the search of explain looks for it. The smallest size that is accepted is first located by the search's own test
// of that effect alone, then confirmed by the whole question (the effect, what it is confused with, what the model has): right name first, or tied.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <system_error>
#include <thread>

#include <driveid/diagnose.h>

#include "diagnose/compare_core.hpp"
#include "diagnose/explain_core.hpp"
#include "diagnose/fit_task.hpp"

namespace driveid::diagnose {
namespace {

using nlohmann::ordered_json;

constexpr double kWorth = 12;      // as explain: log-likelihood beyond its cost
constexpr int kSteps = 7;          // halvings of the logarithmic range
constexpr int kRounds = 3;         // of explaining what the record has already
constexpr int kStretches = 100;    // of the remaining noise
constexpr double kClimb = 0.7;     // from the size that is found alone to the one that is named: steps of a factor of two

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

// What every injection starts from: the equation with nothing left that explain finds, its candidates, and what the model has.
struct Bench {
  Equation clean;
  std::vector<Candidate> candidates;
  std::vector<Member> members;
  Nominal nominal;
  double floor_lo = 0, floor = 0;
};

bool found_alone(const Bench &b, const Injection &injected, int index) {
  const Candidate &c = b.candidates[std::size_t(index)];
  Equation e = b.clean;
  e.y += injected.force;
  Search search(e, b.candidates, 1);
  Option o = c.axis.empty() ? search.refine(index, b.members, {}) : search.refine(index, b.members, middle_shape(c));
  return o.possible && o.worth() > kWorth && o.held_gain > 0;
}

// The question as explain asks it, among the effect, its rivals and the model's own.
bool found_first(const Bench &b, const driveid_model &model, const Candidate &c, const Injection &injected) {
  Equation e = b.clean;
  e.y += injected.force;
  Settings settings;
  settings.threads = 1;
  settings.most_effects = 2;
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

ordered_json hidden(ordered_json entry, const Candidate &c, const char *why) {
  entry["found"] = false;
  entry["why"] = std::string(why) + (c.info ? std::string("; record: ") + c.info->separated_by : "");
  return entry;
}

ordered_json smallest(const Bench &b, const driveid_model &model, int index) {
  const Candidate &c = b.candidates[std::size_t(index)];
  ordered_json entry = {{"effect", c.name}, {"equation", b.clean.signal}};
  auto at = [&](double log_size) { return inject(b.clean, c, b.nominal, std::exp(std::min(0.0, log_size))); };
  double lo = std::log(1e-5), hi = 0;
  if (!found_alone(b, at(0), index)) return hidden(entry, c, "this motion does not show it at any size");
  for (int k = 0; k < kSteps; k++) {
    const double middle = 0.5 * (lo + hi);
    (found_alone(b, at(middle), index) ? hi : lo) = middle;
  }
  while (!found_first(b, model, c, at(hi))) {
    if (hi >= 0) return hidden(entry, c, "it would be taken for something else in this motion");
    hi += kClimb;
  }
  const Injection injected = at(hi);
  const double rms = std::sqrt(injected.force.squaredNorm() / double(b.clean.rows));
  entry["found"] = true;
  entry["smallest"] = published_json(b.clean, c, injected.published);
  entry["rms"] = rms;
  entry["unit"] = b.clean.unit;
  entry["times_floor"] = b.floor > 0 ? ordered_json(rms / b.floor) : ordered_json(nullptr);
  return entry;
}

bool wanted(const Task &task, const std::string &name) {
  if (!task.options.contains("effects") || !task.options["effects"].is_array() || task.options["effects"].empty()) return true;
  for (const auto &e : task.options["effects"])
    if (e == name) return true;
  return false;
}

// The noise that stays, with the sign of every other stretch or so turned: as large and as coloured, and nothing in it goes with the motion any more.
Eigen::VectorXd turned(const Eigen::VectorXd &residual) {
  Eigen::VectorXd out = residual;
  const Eigen::Index stretch = std::max<Eigen::Index>(20, out.size() / kStretches);
  std::uint64_t state = 1;
  for (Eigen::Index k = 0; k < out.size(); k += stretch) {
    state = state * 6364136223846793005u + 1442695040888963407u;
    if (state >> 63) out.segment(k, std::min(stretch, out.size() - k)) *= -1;
  }
  return out;
}

Bench make_bench(Equation e, const driveid_model &model, int threads, const std::function<bool(double)> &tick) {
  const Floor floor = find_floor(e, make_families(e));
  Bench b;
  b.floor = std::max(floor.lo, floor.hi);
  b.floor_lo = std::min(floor.lo, floor.hi);
  b.clean = std::move(e);
  for (int round = 0; round < kRounds; round++) {   // what explain finds already is not to be found again
    std::vector<Notice> notices;
    Settings settings;
    settings.threads = threads;
    settings.tick = [&](double d) { return tick((double(round) + d) / kRounds); };
    const Analysis present = analyse(b.clean, model, settings, notices);
    if (present.search->cancelled()) throw Cancelled{};
    b.candidates = present.search->candidates();
    b.nominal = present.search->nominal();
    b.members.clear();
    for (const Member &m : present.chosen)
      if (m.kept) b.members.push_back(m);
    if (present.before.residual.size() != present.after.residual.size()) break;
    b.clean.y -= present.before.residual - present.after.residual;
    if (present.found.empty() || round + 1 == kRounds) {
      b.clean.y += turned(present.after.residual) - present.after.residual;
      break;
    }
  }
  return b;
}

// Each effect by itself, shared out among the threads; this one reports.
std::vector<ordered_json> smallest_of_each(const Bench &b, const driveid_model &model, const std::vector<int> &asked, Task &task, double from, double to) {
  std::vector<ordered_json> out(asked.size());
  std::atomic<std::size_t> next{0};
  std::atomic<bool> stop{false};
  std::exception_ptr failure;
  std::mutex lock;
  auto work = [&](bool reports) {
    try {
      for (std::size_t k = next++; k < asked.size() && !stop; k = next++) {
        if (reports && !task.tick(from + (to - from) * double(k) / double(asked.size()), b.candidates[std::size_t(asked[k])].name.c_str())) stop = true;
        else out[k] = smallest(b, model, asked[k]);
      }
    } catch (...) {
      const std::lock_guard guard(lock);
      failure = std::current_exception();
      stop = true;
    }
  };
  std::vector<std::thread> pool;
  try {
    for (int k = 1; k < std::clamp(task.threads, 1, 16); k++) pool.emplace_back(work, false);
  } catch (const std::system_error &) {   // fewer threads do it as well
  }
  work(true);
  for (std::thread &t : pool) t.join();
  if (failure) std::rethrow_exception(failure);
  if (stop) throw Cancelled{};
  return out;
}

void power(Task &task, ordered_json &document) {
  FitOptions options;
  options.threads = task.threads;
  options.refine = false;
  const FitOutcome fitted = fit_model(task.model, task.training, {}, options);
  if (!fitted.bad.empty()) throw BadData(fitted.bad);
  const EquationSet set = make_equations(fitted.model, task.training, {});
  if (!set.bad.empty()) throw BadData(set.bad);
  document["effects"] = ordered_json::array();
  double done = 0;
  for (const Equation &e : set.equation) {
    if (!task.tick(done, "what is there already")) throw Cancelled{};
    const double share = 1.0 / double(set.equation.size());
    const Bench b = make_bench(e, fitted.model, task.threads, [&](double d) { return task.tick(done + 0.1 * share * d, "what is there already"); });
    std::vector<int> asked;
    for (std::size_t k = 0; k < b.candidates.size(); k++) {
      const bool in_model = std::any_of(b.members.begin(), b.members.end(), [&](const Member &m) { return m.candidate == int(k); });
      if (!in_model && wanted(task, b.candidates[k].name)) asked.push_back(int(k));
    }
    for (ordered_json &entry : smallest_of_each(b, fitted.model, asked, task, done + 0.1 * share, done + share)) document["effects"].push_back(std::move(entry));
    done += share;
    document["noise_floor"].push_back({{"equation", e.signal}, {"unit", e.unit}, {"noise_floor", {b.floor_lo, b.floor}}});
  }
  task.tick(1.0, "done");
}

}  // namespace
}  // namespace driveid::diagnose

extern "C" driveid_status driveid_power(const driveid_task *task, char **json, char *message, size_t message_size) {
  return driveid::diagnose::answer(task, json, message, message_size, driveid::diagnose::power);
}
