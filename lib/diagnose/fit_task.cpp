// SPDX-License-Identifier: Apache-2.0
#include "diagnose/fit_task.hpp"

#include <cstdio>
#include <new>

#include <driveid/version.h>

#include "model/file/text.hpp"

namespace driveid::diagnose {

using nlohmann::ordered_json;

namespace {

struct Refused {
  driveid_status status;
  std::string text;
};

void check_record(const driveid_record &r) {
  if (!r.t_ns || (r.columns && !r.column)) throw Refused{DRIVEID_ERR_ARGUMENT, "a record has no stamps or no columns"};
  for (size_t c = 0; c < r.columns; c++)
    if (!r.column[c].name || !r.column[c].value) throw Refused{DRIVEID_ERR_ARGUMENT, "a column has no name or no values"};
}

Task load(const driveid_task &raw) {
  Task task;
  char message[512] = "";
  if (const driveid_status s = driveid_model_read(raw.model_toml, &task.model, message, sizeof message)) throw Refused{s, message};
  char *history = nullptr;
  if (driveid_model_history(raw.model_toml, &history, nullptr, 0) == DRIVEID_OK) {
    task.history = history;
    driveid_text_free(history);
  }
  if (raw.options_json) {
    task.options = nlohmann::json::parse(raw.options_json, nullptr, false);
    if (task.options.is_discarded() || !task.options.is_object()) throw Refused{DRIVEID_ERR_ARGUMENT, "the options are not a JSON object"};
  }
  task.threads = task.options.contains("threads") && task.options["threads"].is_number_integer() ? task.options["threads"].get<int>() : 2;
  task.tick = [&raw](double done, const char *what) { return !raw.progress || raw.progress(raw.progress_context, done, what) == 0; };
  return task;
}

void prepare_records(const driveid_task &raw, Task &task) {
  for (size_t k = 0; k < raw.trainings; k++) check_record(raw.training[k]);
  for (size_t k = 0; k < raw.held_outs; k++) check_record(raw.held_out[k]);
  for (size_t k = 0; k < raw.trainings; k++) task.training.push_back(prepare(raw.training[k], task.model));
  for (size_t k = 0; k < raw.held_outs; k++) task.held_out.push_back(prepare(raw.held_out[k], task.model));
}

ordered_json records_json(const Task &task) {
  ordered_json out = ordered_json::array();
  auto add = [&](const Prepared &p, const char *role) { out.push_back({{"name", p.name}, {"rows", p.rows}, {"span_s", p.span_s}, {"hash", p.hash}, {"role", role}}); };
  for (const Prepared &p : task.training) add(p, "training");
  for (const Prepared &p : task.held_out) add(p, "held_out");
  return out;
}

std::vector<Notice> record_notices(const Task &task) {
  std::vector<Notice> out;
  for (const auto *list : {&task.training, &task.held_out})
    for (const Prepared &p : *list)
      for (Notice n : p.notices) {
        if (n.record.empty()) n.record = p.name;
        out.push_back(n);
      }
  return out;
}

driveid_status say(driveid_status status, char *message, size_t size, const std::string &text) {
  if (message && size) std::snprintf(message, size, "%s", text.c_str());
  return status;
}

}  // namespace

ordered_json notices_json(const std::vector<Notice> &notices) {
  ordered_json out = ordered_json::array();
  for (const Notice &n : notices) out.push_back({{"kind", n.kind}, {"record", n.record}, {"text", n.text}});
  return out;
}

std::string number_text(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

std::string model_text(const driveid_model &model, const std::string &history) {
  char *text = nullptr;
  if (driveid_model_write(&model, history.c_str(), &text)) throw std::bad_alloc();
  std::string out = text;
  driveid_text_free(text);
  return out;
}

namespace {

ordered_json param_json(const driveid_param &p) {
  static const char *const states[] = {"unset", "free", "given"};
  if (p.state == DRIVEID_PARAM_UNSET) return {{"value", nullptr}, {"interval", nullptr}, {"unit", p.unit}, {"state", states[p.state]}};
  return {{"value", p.value}, {"interval", {p.lo, p.hi}}, {"unit", p.unit}, {"state", states[p.state]}};
}

}  // namespace

ordered_json parameters_json(const driveid_model &model) {
  ordered_json out = ordered_json::object();
  for (uint32_t k = 0; k < model.params; k++) out[model.param[k].name] = param_json(model.param[k]);
  for (uint32_t e = 0; e < model.effects; e++)
    for (uint32_t k = 0; k < model.effect[e].params; k++) {
      const driveid_param &p = model.effect[e].param[k];
      std::string name = p.name;
      if (out.contains(name)) name = std::string(model.effect[e].name) + "." + name;
      for (int n = 2; out.contains(name); n++) name = std::string(model.effect[e].name) + "_" + std::to_string(n) + "." + p.name;
      out[name] = param_json(p);
    }
  return out;
}

driveid_status answer(const driveid_task *raw, char **json, char *message, size_t message_size, const std::function<void(Task &, ordered_json &)> &work) {
  if (message && message_size) message[0] = 0;
  if (!raw || !json || !raw->model_toml || !raw->training || !raw->trainings || (raw->held_outs && !raw->held_out)) return say(DRIVEID_ERR_ARGUMENT, message, message_size, "a model and at least one record are needed");
  *json = nullptr;
  try {
    Task task = load(*raw);
    prepare_records(*raw, task);
    ordered_json document = {{"format", DRIVEID_FORMAT}, {"driveid", DRIVEID_VERSION}, {"model", raw->model_toml}, {"records", records_json(task)}};
    document["notices"] = notices_json(record_notices(task));
    driveid_status status = DRIVEID_OK;
    try {
      for (const auto *list : {&task.training, &task.held_out})
        for (const Prepared &p : *list)
          if (!p.bad.empty()) throw BadData(p.name + ": " + p.bad);
      work(task, document);
    } catch (const BadData &bad) {
      document["verdict"] = "bad_data";
      document["message"] = bad.what();
      status = say(DRIVEID_ERR_DATA, message, message_size, bad.what());
    }
    *json = text_copy(document.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
    return status;
  } catch (const Refused &r) {
    return say(r.status, message, message_size, r.text);
  } catch (const Cancelled &) {
    return say(DRIVEID_NOT_YET, message, message_size, "cancelled");
  } catch (const std::bad_alloc &) {
    return say(DRIVEID_ERR_MEMORY, message, message_size, "out of memory");
  } catch (const std::exception &e) {
    return say(DRIVEID_ERR_NUMERIC, message, message_size, std::string("the analysis failed: ") + e.what());
  }
}

}  // namespace driveid::diagnose
