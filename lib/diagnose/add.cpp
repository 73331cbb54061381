// SPDX-License-Identifier: Apache-2.0
// New models, models with one effect more, and the catalogue as JSON.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>
#include <string>

#include <nlohmann/json.hpp>

#include <driveid/diagnose.h>
#include <driveid/effect.h>

#include "diagnose/explain.hpp"
#include "model/file/text.hpp"

namespace {

using nlohmann::ordered_json;

driveid_status fail(driveid_status status, char *message, size_t size, const std::string &text) {
  if (message && size) std::snprintf(message, size, "%s", text.c_str());
  return status;
}

std::string param_names(const driveid_model &model) {
  std::string list;
  for (uint32_t k = 0; k < model.params; k++) list += (k ? ", " : "") + std::string(model.param[k].name);
  if (model.structure == DRIVEID_STRUCTURE_LINEAR_AXIS) return list + ", K_F_N_A";
  if (model.structure == DRIVEID_STRUCTURE_PMSM_DRIVE) return list + ", pole_pairs";
  if (model.structure == DRIVEID_STRUCTURE_LTI) return list + ", n (order), m (order of the input side)";
  return model.structure == DRIVEID_STRUCTURE_DC_CIRCUIT ? list : list + ", K_t_Nm_A";
}

driveid_status give(driveid_model &model, const char *text, char *message, size_t size) {
  const char *equals = text ? std::strchr(text, '=') : nullptr;
  if (!equals) return fail(DRIVEID_ERR_ARGUMENT, message, size, "\"" + std::string(text ? text : "") + "\" is not NAME=VALUE, for example K_t_Nm_A=0.05");
  const std::string name(text, equals);
  char *end = nullptr;
  const double value = std::strtod(equals + 1, &end);
  if (end == equals + 1 || *end) return fail(DRIVEID_ERR_ARGUMENT, message, size, "value of \"" + name + "\" is not a number: \"" + (equals + 1) + "\"");
  if (driveid_model_give(&model, name.c_str(), value))
    return fail(DRIVEID_ERR_ARGUMENT, message, size,
                "structure \"" + std::string(driveid_structure_name(model.structure)) + "\" has no parameter \"" + name + "\" that can be " + (equals + 1) + "; known are " + param_names(model));
  return DRIVEID_OK;
}

const char *kind_text(driveid_effect_kind kind) {
  static const char *const text[] = {"term", "state", "channel", "drift", "structure"};
  return text[kind];
}

ordered_json names(const char *const *list) {
  ordered_json out = ordered_json::array();
  for (int k = 0; k < DRIVEID_EFFECT_NAMES_MAX && list[k]; k++) out.push_back(list[k]);
  return out;
}

ordered_json param_json(const driveid_effect_info &info, uint32_t k) {
  const driveid_effect_param &p = info.param[k];
  ordered_json units = ordered_json::object();
  static const struct { const char *key; driveid_frame frame; } frames[] = {{"rotary", DRIVEID_FRAME_TORQUE}, {"linear", DRIVEID_FRAME_FORCE}, {"per_ampere", DRIVEID_FRAME_AMPERE}, {"per_volt", DRIVEID_FRAME_VOLT}};
  for (const auto &f : frames) {
    char name[DRIVEID_NAME_SIZE], unit[24];
    const char drive = f.frame == DRIVEID_FRAME_VOLT ? 'V' : 'A';
    driveid_effect_param_name(&info, k, f.frame, drive, name, sizeof name);
    driveid_effect_param_unit(&info, k, f.frame, drive, unit, sizeof unit);
    units[f.key] = {{"name", name}, {"unit", unit}};
  }
  const ordered_json first = units["rotary"];
  return {{"name", first["name"]}, {"unit", first["unit"]}, {"bounds", {p.lo, p.hi}}, {"typical", p.typical}, {"meaning", p.text}, {"names", units}};
}

ordered_json effect_json(const driveid_effect_info &info) {
  ordered_json parameters = ordered_json::array(), domains = ordered_json::array();
  for (uint32_t k = 0; k < info.params; k++) parameters.push_back(param_json(info, k));
  if (info.domains & DRIVEID_EFFECT_MECHANICAL) domains.push_back("mechanical");
  if (info.domains & DRIVEID_EFFECT_ELECTRICAL) domains.push_back("electrical");
  return {{"name", info.name}, {"equation", info.equation}, {"kind", kind_text(info.kind)}, {"domains", domains}, {"parameters", parameters},
          {"signature", info.signature}, {"contains", names(info.subsumes)}, {"confused_with", names(info.confused_with)},
          {"separated_by", info.separated_by}, {"literature", info.literature}};
}

}  // namespace

namespace driveid::diagnose {

driveid_status add_in_place(driveid_model &model, const char *effect, char *reason, std::size_t reason_size) {
  driveid_model grown = model;
  if (const driveid_effect_info *info = driveid_effect_find(effect))
    for (const char *contained : info->subsumes)
      for (uint32_t e = grown.effects; contained && e-- > 0;)
        if (!std::strcmp(grown.effect[e].name, contained)) std::copy(grown.effect + e + 1, grown.effect + grown.effects, grown.effect + e), grown.effects--;
  const driveid_status status = driveid_model_add(&grown, effect, nullptr, nullptr, reason, reason_size);
  if (status == DRIVEID_OK) model = grown;
  return status;
}

}  // namespace driveid::diagnose

extern "C" driveid_status driveid_new(const char *structure, const char *const *given, size_t givens, char **toml, char *message, size_t message_size) {
  if (message && message_size) message[0] = 0;
  if (!structure || !toml || (givens && !given)) return DRIVEID_ERR_ARGUMENT;
  driveid_structure which;
  if (driveid_structure_from_name(structure, &which)) {
    std::string list;
    for (int s = 0; s < DRIVEID_STRUCTURE_COUNT; s++) list += (s ? ", " : "") + std::string(driveid_structure_name(static_cast<driveid_structure>(s)));
    return fail(DRIVEID_ERR_ARGUMENT, message, message_size, "unknown structure \"" + std::string(structure) + "\"; known are " + list);
  }
  driveid_model model;
  driveid_model_init(&model, which);
  for (size_t k = 0; k < givens; k++)
    if (const driveid_status s = give(model, given[k], message, message_size)) return s;
  return driveid_model_write(&model, nullptr, toml);
}

extern "C" driveid_status driveid_add(const char *model_toml, const char *effect, char **new_toml, char *message, size_t message_size) {
  if (message && message_size) message[0] = 0;
  if (!model_toml || !effect || !new_toml) return DRIVEID_ERR_ARGUMENT;
  driveid_model model;
  if (const driveid_status s = driveid_model_read(model_toml, &model, message, message_size)) return s;
  if (const driveid_status s = driveid::diagnose::add_in_place(model, effect, message, message_size)) return s;
  char *history = nullptr;
  if (const driveid_status s = driveid_model_history(model_toml, &history, message, message_size)) return s;
  const std::string grown = std::string(history) + (history[0] ? "\n\n" : "") + "[[history]]\nstep = \"add " + effect + "\"";
  driveid_text_free(history);
  return driveid_model_write(&model, grown.c_str(), new_toml);
}

extern "C" driveid_status driveid_catalogue(char **json) {
  if (!json) return DRIVEID_ERR_ARGUMENT;
  try {
    ordered_json effects = ordered_json::array();
    for (uint32_t k = 0; k < driveid_effect_count(); k++) effects.push_back(effect_json(*driveid_effect_at(k)));
    *json = driveid::text_copy(ordered_json{{"format", 1}, {"effects", effects}}.dump(2));
    return DRIVEID_OK;
  } catch (const std::bad_alloc &) {
    return DRIVEID_ERR_MEMORY;
  }
}
