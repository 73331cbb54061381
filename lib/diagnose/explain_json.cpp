// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>

#include <driveid/version.h>

#include "diagnose/compare_core.hpp"
#include "diagnose/explain.hpp"
#include "diagnose/locate.hpp"
#include "model/file/text.hpp"

namespace driveid::diagnose {

using nlohmann::ordered_json;

ordered_json parameters_json(const std::vector<Value> &parameters) {
  ordered_json out = ordered_json::object();
  for (const Value &v : parameters) out[v.name] = {{"value", v.value}, {"interval", {v.lo, v.hi}}, {"unit", v.unit}};
  return out;
}

ordered_json head_json(const driveid_task &task, const Explanation &x) {
  ordered_json records = ordered_json::array();
  for (auto *list : {&x.training, &x.held_out})
    for (const Prepared &p : *list) {
      ordered_json r = {{"name", p.name}, {"rows", p.rows}, {"span_s", p.span_s}, {"hash", p.hash.empty() ? ordered_json(nullptr) : ordered_json(p.hash)}, {"role", list == &x.held_out ? "held_out" : "training"}, {"held_out", list == &x.held_out}};
      records.push_back(r);
    }
  return {{"format", DRIVEID_FORMAT}, {"driveid", DRIVEID_VERSION}, {"model", task.model_toml}, {"records", records}};
}

namespace {

double level_where(const Equation &e, bool held) {   // of the drive, for fit in percent
  double s = 0, m = 0, n = 0;
  for (std::size_t k = 0; k < e.rows; ++k)
    if ((e.block_held_out[std::size_t(e.block[k])] != 0) == held) m += e.drive[Eigen::Index(k)], n += 1;
  if (n == 0) return 0;
  m /= n;
  for (std::size_t k = 0; k < e.rows; ++k)
    if ((e.block_held_out[std::size_t(e.block[k])] != 0) == held) s += std::pow(e.drive[Eigen::Index(k)] - m, 2);
  return std::sqrt(s / n);
}

// The equation that tells most stands for the model; the others are listed beside it.
const Analysis *leading(const Explanation &x) {
  const Analysis *best = x.analysis.empty() ? nullptr : &x.analysis.front();   // also where a score is no number
  double most = -1;
  for (const Analysis &a : x.analysis) {
    double gone = a.before.score.total > 0 ? a.removable / a.before.score.total : 0;
    if (gone > most) most = gone, best = &a;
  }
  return best;
}

ordered_json equation_error(const Analysis &a, const Solution &s, bool held) {
  const Equation &e = a.search->equation();
  double rmse = rms_where(e, s.residual, held), level = level_where(e, held);
  double hi = std::min(a.floor.hi, rms_where(e, a.after.residual, held));
  return {{"rmse", rmse}, {"unit", e.unit}, {"signal", e.signal}, {"noise_floor", {std::min(a.floor.lo, hi), hi}}, {"fit_percent", level > 0 ? 100 * (1 - rmse / level) : 0.0}};
}

ordered_json where_json(const Explanation &x) {
  ordered_json out = ordered_json::array();
  for (const Analysis &a : x.analysis) {
    Eigen::VectorXd floor = a.after.residual;
    if (a.floor.flexible.size() == floor.size()) {
      Eigen::VectorXd flexible = a.before.residual - a.floor.flexible;
      if (flexible.squaredNorm() < floor.squaredNorm()) floor = flexible;
    }
    for (const Regime &r : locate(a.search->equation(), a.before.residual, floor)) {
      if (out.size() >= 40) break;
      out.push_back({{"equation", a.search->equation().signal}, {"axis", r.axis}, {"regime", r.text}, {"share", r.share}, {"rows", r.rows},
                     {"statistic", r.statistic}, {"bound", r.bound}, {"significant", r.significant}});
      if (r.lo < r.hi) out.back()["range"] = {r.lo, r.hi};   // on the axis (of the absolute value for speed, acceleration, current, drive)
    }
  }
  return out;
}

}  // namespace

ordered_json explanation_json(const Explanation &x, const driveid_task &task, const Options &options) {
  ordered_json j = head_json(task, x);
  j["verdict"] = x.verdict;
  if (x.verdict == "bad_data") {
    j["message"] = x.message;
    j["ranked"] = ordered_json::array();
    j["where"] = ordered_json::array();
    j["error_before"] = j["error_after"] = j["shape"] = nullptr;
    j["next_record"] = {{"motion", x.message}, {"why", "this record cannot answer"}, {"separates", ordered_json::array()}, {"set_points", ordered_json::array()}};
    j["notices"] = notices_json(x.notices);
    return j;
  }
  ordered_json ranked = ordered_json::array();
  for (const Ranked &r : x.ranked) {
    ordered_json e = {{"effect", r.effect}, {"accepted", r.accepted}, {"share", r.share}, {"confidence", r.confidence}, {"parameters", parameters_json(r.parameters)}, {"not_told_apart_from", r.ties}};
    if (r.accepted) e["evidence"] = {{"gain", r.worth}, {"lead", r.lead}, {"family", r.family}, {"family_beyond", r.beyond}};
    if (!r.why.empty()) e["why_not"] = r.why;
    const driveid_effect_info *info = driveid_effect_find(r.effect.c_str());
    if (info) e["equation"] = info->equation;
    ranked.push_back(e);
  }
  j["ranked"] = ranked;
  j["where"] = where_json(x);
  const Analysis *lead = leading(x);
  ordered_json before, after;
  for (bool held : {false, true}) {
    const char *key = held ? "held_out" : "training";
    before[key] = {{"equation", equation_error(*lead, lead->before, held)}};
    after[key] = {{"equation", equation_error(*lead, lead->after, held)}};
    if (options.errors) {
      const std::vector<Prepared> &records = held ? x.held_out : x.training;
      before[key].update(simulated_errors(x.model, records, before[key]["equation"]));
      after[key].update(simulated_errors(x.added == 0 ? x.model : x.grown, records, after[key]["equation"]));
    }
  }
  j["error_before"] = before;
  j["error_after"] = after;
  j["removable"] = {{"equation", lead->search->equation().signal}, {"share_of_squared_error", lead->before.score.total > 0 ? lead->removable / lead->before.score.total : 0}, {"explained", lead->explained}};
  j["next_record"] = next_record(x);
  j["shape"] = x.verdict == "unknown" ? x.shape : ordered_json(nullptr);
  j["notices"] = notices_json(x.notices);
  return j;
}

}  // namespace driveid::diagnose

namespace {

driveid_status fail(driveid_status status, char *message, std::size_t size, const std::string &text) {
  if (message && size) std::snprintf(message, size, "%s", text.c_str());
  return status;
}

}  // namespace

extern "C" driveid_status driveid_explain(const driveid_task *task, char **json, char *message, size_t message_size) {
  using namespace driveid::diagnose;
  if (message && message_size) message[0] = 0;
  if (!task || !json || !task->model_toml || !task->training || task->trainings == 0) return DRIVEID_ERR_ARGUMENT;
  *json = nullptr;
  try {
    driveid_model model;
    if (driveid_status s = driveid_model_read(task->model_toml, &model, message, message_size)) return s;
    Options options = options_of(task->options_json);
    Explanation x = explain(model, *task, options);
    if (x.cancelled) return DRIVEID_NOT_YET;
    *json = driveid::text_copy(explanation_json(x, *task, options).dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
    if (x.verdict == "bad_data") return fail(DRIVEID_ERR_DATA, message, message_size, x.message);
    return DRIVEID_OK;
  } catch (const std::bad_alloc &) {
    return fail(DRIVEID_ERR_MEMORY, message, message_size, "out of memory");
  } catch (const std::exception &e) {
    return fail(DRIVEID_ERR_NUMERIC, message, message_size, e.what());
  }
}
