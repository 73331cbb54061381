// SPDX-License-Identifier: Apache-2.0
#include <driveid/diagnose.h>

#include "diagnose/compare_core.hpp"
#include "diagnose/fit_task.hpp"
#include "diagnose/standstill.hpp"

namespace driveid::diagnose {
namespace {

using nlohmann::ordered_json;

std::string first_unset(const driveid_model &model) {
  for (uint32_t k = 0; k < model.params; k++)
    if (model.param[k].state == DRIVEID_PARAM_UNSET) return model.param[k].name;
  for (uint32_t e = 0; e < model.effects; e++)
    for (uint32_t k = 0; k < model.effect[e].params; k++)
      if (model.effect[e].param[k].state == DRIVEID_PARAM_UNSET) return std::string(model.effect[e].name) + "." + model.effect[e].param[k].name;
  return "";
}

// A model that was never fitted cannot be compared: it is fitted to the training records first, and that is said.
driveid_model with_values(const Task &task, ordered_json &document) {
  driveid_model model = task.model;
  const bool lumped = model.structure == DRIVEID_STRUCTURE_DC_DRIVE && driveid_model_frame(&model) == DRIVEID_FRAME_VOLT;
  const std::string unset = lumped ? "" : first_unset(model);
  if (unset.empty()) return model;
  FitOptions options;
  options.threads = task.threads;
  options.tick = [&](double done, const char *what) { return task.tick(0.3 * done, what); };
  const FitOutcome outcome = fit_model(model, task.training, task.held_out, options);
  if (outcome.cancelled) throw Cancelled{};
  if (!outcome.bad.empty()) throw BadData(outcome.bad);
  document["notices"].push_back({{"kind", "fitted"}, {"record", ""}, {"text", unset + " has no value: the model was fitted to the training records first"}});
  return outcome.model;
}

void compare(Task &task, ordered_json &document) {
  const driveid_model model = with_values(task, document);
  std::string reason;
  std::size_t index = 0;
  const std::size_t count = task.training.size() + task.held_out.size();
  for (const auto *list : {&task.training, &task.held_out})
    for (const Prepared &record : *list) {
      if (!task.tick(0.3 + 0.7 * double(index) / double(count), "compare")) throw Cancelled{};
      driveid_model here = model;
      if (!adopt_frame(here, record, reason) || driveid_model_frame(&here) != driveid_model_frame(&model))
        throw BadData(record.name + ": " + (reason.empty() ? "its columns give the parameters other units than the model has; fit the model to this kind of record" : reason));
      if (const std::string still = standstill(record, roles_of(model, record)); !still.empty()) throw BadData(record.name + ": " + still);
      const Compared c = compare_record(model, record);
      if (c.errors.free_run.rmse < 0 && c.errors.equation.rmse < 0) throw BadData(record.name + ": no column lets this model be compared");
      for (const auto &n : notices_json(c.notices)) document["notices"].push_back(n);
      ordered_json &entry = document["records"][index++];
      const ordered_json errors = to_json(c.errors);
      entry.update(errors);
      entry["errors"] = errors;
      entry["tests"] = ordered_json::array();
      for (const ResidualTest &t : c.tests) entry["tests"].push_back({{"name", t.name}, {"statistic", t.statistic}, {"bound", t.bound}, {"passed", t.passed}});
      entry["where"] = c.where;
      if (c.errors.free_run.rmse >= 0) document["free_run_rmse"] = c.errors.free_run.rmse;
    }
  document["parameters"] = parameters_json(model);
  task.tick(1.0, "done");
}

}  // namespace
}  // namespace driveid::diagnose

extern "C" driveid_status driveid_compare(const driveid_task *task, char **json, char *message, size_t message_size) {
  return driveid::diagnose::answer(task, json, message, message_size, driveid::diagnose::compare);
}
