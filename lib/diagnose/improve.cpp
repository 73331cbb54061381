// SPDX-License-Identifier: Apache-2.0
// The staircase: add what explain accepts, one step at a time, fit again, compare; ends at the noise floor, at a tie, or at
// something unknown, and says which.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "diagnose/compare_core.hpp"
#include "diagnose/explain.hpp"
#include "model/file/text.hpp"

namespace driveid::diagnose {
namespace {

using nlohmann::ordered_json;

std::string written(const driveid_model &model, const char *history) {
  char *text = nullptr;
  if (driveid_model_write(&model, history, &text) != DRIVEID_OK) return "";
  std::string out = text;
  driveid_text_free(text);
  return out;
}

bool fit_again(const driveid_task &task, const std::string &toml, std::string &fitted) {
  driveid_task t = task;
  t.model_toml = toml.c_str();
  t.progress = nullptr;
  char *json = nullptr, message[300];
  bool ok = driveid_fit(&t, &json, message, sizeof message) == DRIVEID_OK && json;
  if (ok) {
    ordered_json j = ordered_json::parse(json, nullptr, false);
    ok = j.is_object() && j.contains("model_toml") && j["model_toml"].is_string();
    if (ok) fitted = j["model_toml"].get<std::string>();
  }
  driveid_text_free(json);
  return ok;
}

ordered_json equation_set(const Analysis &a, const Solution &s, bool held) {
  const Equation &e = a.search->equation();
  double level = 0;
  for (Eigen::Index k = 0; k < e.drive.size(); ++k) level += e.drive[k] * e.drive[k];
  level = std::sqrt(level / std::max<double>(1, double(e.rows)));
  double rmse = rms_where(e, s.residual, held);
  return {{"rmse", rmse}, {"unit", e.unit}, {"signal", e.signal}, {"noise_floor", {std::min(a.floor.lo, a.floor.hi), a.floor.hi}}, {"fit_percent", level > 0 ? 100 * (1 - rmse / level) : 0}};
}

constexpr double kReached = 0.05;   // share of the removable error; what is below belongs to the floor's own bracket

void copy_values(driveid_model &to, const driveid_model &from) {
  for (unsigned k = 0; k < to.params; ++k)
    for (unsigned m = 0; m < from.params; ++m)
      if (!std::strcmp(to.param[k].name, from.param[m].name) && to.param[k].state != DRIVEID_PARAM_GIVEN && from.param[m].state != DRIVEID_PARAM_UNSET) to.param[k] = from.param[m];
}

}  // namespace

ordered_json improve(const driveid_task &task, const Options &options, const Explanation &x) {
  ordered_json j = head_json(task, x);
  ordered_json steps = ordered_json::array();
  const char *ends = "nothing_missing";
  bool any = false, tie = false;
  for (const Ranked &r : x.ranked)
    if (r.accepted) any = true, tie |= !r.ties.empty();
  if (any) ends = "noise_floor";
  if (tie) ends = "tie";
  if (x.verdict == "unknown") ends = "unknown";

  auto entry = [&](const std::string &effect, const ordered_json &parameters, const std::string &toml, const ordered_json &training, const ordered_json &held, double left) {
    ordered_json s = {{"step", steps.size()}, {"effect", effect.empty() ? ordered_json(nullptr) : ordered_json(effect)}, {"parameters", parameters}};
    ordered_json t = training, h = held;
    if (options.errors) {
      driveid_model model;
      char message[300];
      if (driveid_model_read(toml.c_str(), &model, message, sizeof message) == DRIVEID_OK) {
        t.update(simulated_errors(model, x.training, t["equation"]));
        h.update(simulated_errors(model, x.held_out, h["equation"]));
      }
    }
    s["errors"] = {{"training", t}, {"held_out", h}};
    s["training"] = t;
    s["held_out"] = h;
    s["share_left"] = left;
    steps.push_back(s);
  };
  std::string toml = written(x.model, nullptr), fitted = toml;
  fit_again(task, toml, fitted);
  const Analysis *lead = nullptr;
  for (const Analysis &a : x.analysis)
    if (!lead || a.found.size() > lead->found.size() || (a.found.size() == lead->found.size() && a.removable / std::max(1e-300, a.before.score.total) > lead->removable / std::max(1e-300, lead->before.score.total))) lead = &a;
  entry("", ordered_json::object(), fitted, {{"equation", equation_set(*lead, lead->before, false)}}, {{"equation", equation_set(*lead, lead->before, true)}}, 1.0);
  std::string history = "[[history]]\nstep = \"start of improve\"";
  // one step an accepted effect, strongest first, the model growing by it
  driveid_model grown = x.model;
  char reason[200];
  for (const Ranked &r : x.ranked) {
    if (!r.accepted) continue;
    for (unsigned k = 0; k < x.grown.effects; ++k) {
      if (std::strcmp(x.grown.effect[k].name, r.effect.c_str())) continue;
      bool there = k + x.added < x.grown.effects;
      if (there) continue;
      if (add_in_place(grown, r.effect.c_str(), reason, sizeof reason) == DRIVEID_OK) grown.effect[grown.effects - 1] = x.grown.effect[k];
    }
    copy_values(grown, x.grown);
    double share = 1;
    ordered_json training, held;
    for (const Analysis &a : x.analysis)
      for (std::size_t f = 0; f < a.found.size(); ++f)
        if (a.found[f].name == r.effect) {
          // the solution with this effect and the ones before it
          std::vector<Member> members;
          for (std::size_t m = 0; m < a.chosen.size(); ++m) {
            bool in = a.chosen[m].kept;
            for (unsigned g = 0; g < grown.effects; ++g) in |= a.search->candidates()[std::size_t(a.chosen[m].candidate)].name == grown.effect[g].name;
            if (in) members.push_back(a.chosen[m]);
          }
          Solution s = a.search->solve(members);
          share = a.removable > 0 ? std::clamp((s.score.total - (a.before.score.total - a.removable)) / a.removable, 0.0, 1.0) : 0;
          training = {{"equation", equation_set(a, s, false)}};
          held = {{"equation", equation_set(a, s, true)}};
        }
    history += "\n\n[[history]]\nstep = \"add " + r.effect + "\"";
    toml = written(grown, history.c_str());
    fitted = toml;
    fit_again(task, toml, fitted);
    entry(r.effect, parameters_json(r.parameters), fitted, training, held, share);
    steps.back()["not_told_apart_from"] = r.ties;
  }
  const double left = steps.back()["share_left"];
  if (any && !tie && left > kReached) ends = "unknown";   // what was added is not all that is missing
  j["verdict"] = x.verdict;
  j["steps"] = steps;
  j["ends"] = ends;
  j["ranked"] = ordered_json::array();
  for (const Ranked &r : x.ranked)
    if (r.accepted) j["ranked"].push_back({{"effect", r.effect}, {"share", r.share}, {"confidence", r.confidence}, {"parameters", parameters_json(r.parameters)}, {"not_told_apart_from", r.ties}});
  j["shape"] = x.verdict == "unknown" ? x.shape : ordered_json(nullptr);
  j["next_record"] = next_record(x);
  std::vector<Notice> notices = x.notices;
  for (Notice &n : notices)
    if (n.kind == "chosen") n.text = "each effect was chosen among the catalogue by the same data; the intervals of the fit do not know of it (explain's do)";
  j["notices"] = notices_json(notices);
  j["model_toml"] = fitted;
  return j;
}

}  // namespace driveid::diagnose

extern "C" driveid_status driveid_improve(const driveid_task *task, char **json, char *message, size_t message_size) {
  using namespace driveid::diagnose;
  if (message && message_size) message[0] = 0;
  if (!task || !json || !task->model_toml || !task->training || task->trainings == 0) return DRIVEID_ERR_ARGUMENT;
  *json = nullptr;
  auto say = [&](driveid_status status, const char *text) {
    if (message && message_size) std::snprintf(message, message_size, "%s", text);
    return status;
  };
  try {
    driveid_model model;
    if (driveid_status s = driveid_model_read(task->model_toml, &model, message, message_size)) return s;
    Options options = options_of(task->options_json);
    Explanation x = explain(model, *task, options);
    if (x.cancelled) return DRIVEID_NOT_YET;
    const bool bad = x.verdict == "bad_data";
    nlohmann::ordered_json j = bad ? explanation_json(x, *task, options) : improve(*task, options, x);
    if (bad) {
      j["steps"] = nlohmann::ordered_json::array();
      j["ends"] = "bad_data";
    }
    *json = driveid::text_copy(j.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
    return bad ? say(DRIVEID_ERR_DATA, x.message.c_str()) : DRIVEID_OK;
  } catch (const std::bad_alloc &) {
    return say(DRIVEID_ERR_MEMORY, "out of memory");
  } catch (const std::exception &e) {
    return say(DRIVEID_ERR_NUMERIC, e.what());
  }
}
