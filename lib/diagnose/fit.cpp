// SPDX-License-Identifier: Apache-2.0
#include <driveid/diagnose.h>

#include "diagnose/compare_core.hpp"
#include "diagnose/fit_task.hpp"

namespace driveid::diagnose {
namespace {

using nlohmann::ordered_json;

FitOptions options_of(const Task &task) {
  FitOptions o;
  o.threads = task.threads;
  if (task.options.contains("refine") && task.options["refine"].is_boolean()) o.refine = task.options["refine"].get<bool>();
  if (task.options.contains("window_s") && task.options["window_s"].is_number()) o.window_s = task.options["window_s"].get<double>();
  if (task.options.contains("whiten") && task.options["whiten"].is_boolean()) o.whiten = task.options["whiten"].get<bool>();
  o.tick = task.tick;
  return o;
}

ErrorSet side(const driveid_model &model, const std::vector<Prepared> &records) {
  std::vector<ErrorSet> sets;
  std::vector<double> rows;
  for (const Prepared &p : records) sets.push_back(compare_record(model, p).errors), rows.push_back(double(p.rows));
  return together(sets, rows);
}

std::string history_entry(const Task &task, const FitOutcome &outcome, const ErrorSet &training, const ErrorSet &held_out) {
  std::string names;
  for (const Prepared &p : task.training) names += (names.empty() ? "" : ", ") + p.name;
  for (char &c : names)
    if (c == '"' || c == '\\' || static_cast<unsigned char>(c) < 0x20) c = '_';
  std::string s = "[[history]]\nstep = \"fit\"\nrecords = \"" + names + "\"\nobjective = \"" + outcome.objective + "\"\n";
  auto put = [&](const char *key, const ErrorObject &e) {
    if (e.rmse >= 0) s += std::string(key) + " = { rmse = " + number_text(e.rmse) + ", unit = \"" + e.unit + "\", signal = \"" + e.signal + "\" }\n";
  };
  put("training_equation", training.equation);
  put("training_free_run", training.free_run);
  put("held_out_equation", held_out.equation);
  put("held_out_free_run", held_out.free_run);
  return s;
}

void fit(Task &task, ordered_json &document) {
  const FitOutcome outcome = fit_model(task.model, task.training, task.held_out, options_of(task));
  if (outcome.cancelled) throw Cancelled{};
  for (const auto &n : notices_json(outcome.notices)) document["notices"].push_back(n);
  if (!outcome.bad.empty()) throw BadData(outcome.bad);
  if (!task.tick(0.9, "errors")) throw Cancelled{};
  const ErrorSet training = side(outcome.model, task.training), held_out = side(outcome.model, task.held_out);
  document["parameters"] = parameters_json(outcome.model);
  document["objective"] = outcome.objective;
  document["error_after"] = {{"training", to_json(training)}, {"held_out", task.held_out.empty() ? ordered_json(nullptr) : to_json(held_out)}};
  document["model_toml"] = model_text(outcome.model, task.history + (task.history.empty() ? "" : "\n\n") + history_entry(task, outcome, training, held_out));
  task.tick(1.0, "done");
}

}  // namespace
}  // namespace driveid::diagnose

extern "C" driveid_status driveid_fit(const driveid_task *task, char **json, char *message, size_t message_size) {
  return driveid::diagnose::answer(task, json, message, message_size, driveid::diagnose::fit);
}
