// SPDX-License-Identifier: Apache-2.0
// Reads the TOML model file. Every complaint names line, key and mend; unknown keys are refused.
#include <cmath>
#include <cstdio>
#include <cstring>
#include <initializer_list>
#include <new>
#include <sstream>
#include <string>
#include <vector>

#define TOML_ASSERT(expression) static_cast<void>(0)  // hostile text is an error, never an abort
#include <tomlpp.hpp>

#include <driveid/effect.h>
#include <driveid/model_file.h>

#include "model/file/text.hpp"

namespace {

struct Complaint {
  driveid_status status;
  std::string text;
};

[[noreturn]] void complain(const toml::node &node, const std::string &text) {
  throw Complaint{DRIVEID_ERR_FORMAT, "line " + std::to_string(node.source().begin.line) + ": " + text};
}

std::string quoted(const std::string &s) { return "\"" + s + "\""; }

void only_keys(const toml::table &table, std::initializer_list<const char *> known, const std::string &where) {
  for (const auto &[key, node] : table) {
    bool found = false;
    std::string list;
    for (const char *k : known) {
      found = found || key.str() == k;
      list += (list.empty() ? "" : ", ") + std::string(k);
    }
    if (!found) complain(node, "unknown key " + quoted(std::string(key.str())) + " in " + where + "; known are " + list);
  }
}

double number(const toml::node &node, const std::string &key) {
  const auto value = node.value<double>();
  if (!value || !std::isfinite(*value)) complain(node, key + " must be a finite number");
  return *value;
}

std::string text(const toml::node &node, const std::string &key) {
  const auto value = node.value<std::string>();
  if (!node.is_string() || !value) complain(node, key + " must be a text in quotes");
  return *value;
}

driveid_param_state state_of(const toml::table &table, const std::string &key, bool has_value) {
  const toml::node *node = table.get("state");
  if (!node) return has_value ? DRIVEID_PARAM_FREE : DRIVEID_PARAM_UNSET;
  const std::string s = text(*node, key + ".state");
  if (s == "free") return DRIVEID_PARAM_FREE;
  if (s == "given") return DRIVEID_PARAM_GIVEN;
  if (s == "unset") return DRIVEID_PARAM_UNSET;
  complain(*node, key + ".state must be \"free\", \"given\" or \"unset\"");
}

void read_interval(const toml::table &table, const std::string &key, driveid_param &param) {
  param.lo = param.hi = param.value;
  const toml::node *node = table.get("interval");
  if (!node) return;
  const toml::array *pair = node->as_array();
  const auto lo = pair && pair->size() == 2 ? pair->get(0)->value<double>() : std::nullopt;
  const auto hi = pair && pair->size() == 2 ? pair->get(1)->value<double>() : std::nullopt;
  if (!lo || !hi || std::isnan(*lo) || std::isnan(*hi) || *lo > *hi) complain(*node, key + ".interval must be [lower, upper]");
  param.lo = *lo;
  param.hi = *hi;
}

void read_param(const toml::node &node, const std::string &key, driveid_param &param) {
  const toml::table *table = node.as_table();
  if (!table) complain(node, key + " must be a table, for example { value = 1.0, state = \"free\" }");
  only_keys(*table, {"value", "interval", "unit", "state"}, key);
  const toml::node *value = table->get("value");
  if (const toml::node *unit = table->get("unit"); unit && text(*unit, key + ".unit") != param.unit && param.unit[0])
    complain(*unit, key + ".unit must be " + quoted(param.unit) + ": convert the value to it");
  param.state = state_of(*table, key, value != nullptr);
  if (param.state == DRIVEID_PARAM_UNSET) return;
  if (!value) complain(node, key + " has no value; give one, or write state = \"unset\"");
  param.value = number(*value, key + ".value");
  read_interval(*table, key, param);
}

bool only_given(const std::string &name) { return name == "K_t_Nm_A" || name == "K_F_N_A" || name == "pole_pairs"; }

std::string known_names(const driveid_model &model) {
  std::string list;
  for (uint32_t k = 0; k < model.params; k++) list += (k ? ", " : "") + std::string(model.param[k].name);
  return list;
}

int unknown_names(const driveid_model &model, const toml::table &parameters) {
  int count = 0;
  for (const auto &[key, node] : parameters)
    if (!only_given(std::string(key.str())) && !driveid_model_param(&model, std::string(key.str()).c_str())) count++;
  return count;
}

void size_lti(driveid_model &model, const toml::table &parameters) {
  int n = 0, m = 0;
  for (const auto &[key, node] : parameters) {
    int order = 0;
    if (std::sscanf(std::string(key.str()).c_str(), "a_%d", &order) == 1 && order + 1 > n) n = order + 1;
    if (std::sscanf(std::string(key.str()).c_str(), "b_%d", &order) == 1 && order > m) m = order;
  }
  if (n) (void)driveid_model_give(&model, "n", n);
  (void)driveid_model_give(&model, "m", m);
}

// The names say the frame: take the one that knows them all.
void choose_frame(driveid_model &model, const toml::table &parameters) {
  if (model.structure == DRIVEID_STRUCTURE_LTI) return size_lti(model, parameters);
  driveid_model best = model;
  for (int frame = 0; frame < DRIVEID_FRAME_COUNT; frame++) {
    driveid_model trial = model;
    if (driveid_model_set_frame(&trial, static_cast<driveid_frame>(frame), nullptr, 0)) continue;
    if (unknown_names(trial, parameters) < unknown_names(best, parameters)) best = trial;
  }
  model = best;
}

void read_parameters(const toml::table &parameters, driveid_model &model) {
  choose_frame(model, parameters);
  for (const auto &[key, node] : parameters) {
    const std::string name(key.str());
    if (only_given(name) && node.as_table()) {
      const toml::node *value = node.as_table()->get("value");
      if (value && driveid_model_give(&model, name.c_str(), number(*value, name + ".value")))
        complain(node, "parameters." + name + " does not fit structure " + quoted(driveid_structure_name(model.structure)) + ", or its value is out of range");
    }
    driveid_param *param = const_cast<driveid_param *>(driveid_model_param(&model, name.c_str()));
    if (!param)
      complain(node, "unknown parameter " + quoted(name) + " of structure " + quoted(driveid_structure_name(model.structure)) + "; known are " + known_names(model));
    read_param(node, "parameters." + name, *param);
    if (only_given(name) && param->state != DRIVEID_PARAM_GIVEN) complain(node, "parameters." + name + " can only be given: write state = \"given\" and a value, or take it out");
  }
}

void read_effect_params(const toml::node &node, driveid_effect_use &use) {
  const toml::table *table = node.as_table();
  const std::string where = "effect " + quoted(use.name);
  if (!table) complain(node, where + ": parameters must be a table");
  for (const auto &[key, value] : *table) {
    driveid_param *param = nullptr;
    std::string list;
    for (uint32_t k = 0; k < use.params; k++) {
      if (key.str() == use.param[k].name) param = &use.param[k];
      list += (k ? ", " : "") + std::string(use.param[k].name);
    }
    if (!param) complain(value, where + ": unknown parameter " + quoted(std::string(key.str())) + "; known are " + list);
    read_param(value, where + " " + param->name, *param);
  }
}

void read_effect(const toml::node &node, driveid_model &model) {
  const toml::table *table = node.as_table();
  if (!table) complain(node, "effect must be [[effect]] tables");
  only_keys(*table, {"name", "formula", "adds_to", "parameters"}, "[[effect]]");
  const toml::node *name = table->get("name"), *formula = table->get("formula"), *adds_to = table->get("adds_to");
  if (!name) complain(node, "[[effect]] has no name");
  char reason[256];
  const std::string formula_text = formula ? text(*formula, "formula") : "", adds_to_text = adds_to ? text(*adds_to, "adds_to") : "";
  if (driveid_model_add(&model, text(*name, "name").c_str(), formula ? formula_text.c_str() : nullptr, adds_to ? adds_to_text.c_str() : nullptr, reason, sizeof reason))
    complain(formula ? *formula : *name, reason);
  if (const toml::node *parameters = table->get("parameters")) read_effect_params(*parameters, model.effect[model.effects - 1]);
}

void check_format(const toml::table &root) {
  const toml::node *format = root.get("format");
  if (!format) throw Complaint{DRIVEID_ERR_FORMAT, "line 1: key \"format\" is missing; write format = 1"};
  if (!format->is_integer() || format->value<int64_t>() != 1) complain(*format, "format must be 1: this file was written by another version");
}

driveid_model read_model(const toml::table &root) {
  check_format(root);
  only_keys(root, {"format", "structure", "parameters", "effect", "history"}, "the model file");
  const toml::node *structure = root.get("structure");
  if (!structure) throw Complaint{DRIVEID_ERR_FORMAT, "line 1: key \"structure\" is missing; write for example structure = \"rigid_axis\""};
  driveid_structure which;
  if (driveid_structure_from_name(text(*structure, "structure").c_str(), &which)) {
    std::string list;
    for (int s = 0; s < DRIVEID_STRUCTURE_COUNT; s++) list += (s ? ", " : "") + std::string(driveid_structure_name(static_cast<driveid_structure>(s)));
    complain(*structure, "unknown structure " + quoted(text(*structure, "structure")) + "; known are " + list);
  }
  driveid_model model;
  driveid_model_init(&model, which);
  if (const toml::node *parameters = root.get("parameters")) {
    if (!parameters->as_table()) complain(*parameters, "parameters must be a table");
    read_parameters(*parameters->as_table(), model);
  }
  if (const toml::node *effects = root.get("effect")) {
    if (!effects->as_array()) complain(*effects, "effect must be [[effect]] tables");
    for (const toml::node &effect : *effects->as_array()) read_effect(effect, model);
  }
  return model;
}

toml::table parse(const char *text) {
  try { // with exceptions, as the daemon uses it: toml++ in both modes does not share one program
    return toml::parse(std::string_view(text));
  } catch (const toml::parse_error &error) {
    throw Complaint{DRIVEID_ERR_FORMAT, "line " + std::to_string(error.source().begin.line) + ": " + std::string(error.description())};
  }
}

template <typename Work>
driveid_status guarded(char *message, size_t message_size, Work work) {
  if (message && message_size) message[0] = 0;
  try {
    work();
    return DRIVEID_OK;
  } catch (const Complaint &c) {
    if (message && message_size) std::snprintf(message, message_size, "%s", c.text.c_str());
    return c.status;
  } catch (const std::bad_alloc &) {
    return DRIVEID_ERR_MEMORY;
  }
}

}  // namespace

extern "C" driveid_status driveid_model_read(const char *text, driveid_model *model, char *message, size_t message_size) {
  if (!text || !model) return DRIVEID_ERR_ARGUMENT;
  return guarded(message, message_size, [&] { *model = read_model(parse(text)); });
}

extern "C" driveid_status driveid_model_history(const char *text, char **history, char *message, size_t message_size) {
  if (!text || !history) return DRIVEID_ERR_ARGUMENT;
  return guarded(message, message_size, [&] {
    const toml::table root = parse(text);
    std::string out;
    if (const toml::node *entries = root.get("history")) {
      toml::table kept;
      kept.insert("history", *entries->as_array());
      std::ostringstream stream;
      stream << toml::toml_formatter(kept);
      out = stream.str();
    }
    *history = driveid::text_copy(out);
  });
}
