// SPDX-License-Identifier: Apache-2.0
// Writes the TOML model file: 17 digits, so that what is read back is the same number.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <string>

#include <driveid/model_file.h>

#include "model/file/text.hpp"

namespace {

std::string number(double value) {
  if (std::isinf(value)) return value > 0 ? "inf" : "-inf";
  char digits[40];
  for (int precision = 15; precision <= 17; precision++) { // the shortest that reads back exactly
    std::snprintf(digits, sizeof digits, "%.*g", precision, value);
    if (std::strtod(digits, nullptr) == value) break;
  }
  std::string s = digits;
  if (s.find_first_of(".en") == std::string::npos) s += ".0";
  return s;
}

std::string escaped(const std::string &raw) {
  std::string s = "\"";
  for (const char c : raw) {
    char code[8];
    if (c == '"' || c == '\\') {
      s += '\\';
      s += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      std::snprintf(code, sizeof code, "\\u%04x", c);
      s += code;
    } else {
      s += c;
    }
  }
  return s + "\"";
}

const char *state_text(driveid_param_state state) {
  return state == DRIVEID_PARAM_GIVEN ? "given" : state == DRIVEID_PARAM_FREE ? "free" : "unset";
}

std::string interval(const driveid_param &p) { return "[" + number(p.lo) + ", " + number(p.hi) + "]"; }

std::string block(const driveid_param &p) {
  std::string s = "\n[parameters." + std::string(p.name) + "]\n";
  if (p.state != DRIVEID_PARAM_UNSET) s += "value = " + number(p.value) + "\n";
  if (p.state == DRIVEID_PARAM_FREE) s += "interval = " + interval(p) + "\n";
  if (p.unit[0]) s += "unit = " + escaped(p.unit) + "\n";
  return s + "state = \"" + state_text(p.state) + "\"\n";
}

std::string line(const driveid_param &p) {
  std::string s = "parameters." + std::string(p.name) + " = { ";
  if (p.state != DRIVEID_PARAM_UNSET) s += "value = " + number(p.value) + ", ";
  if (p.state == DRIVEID_PARAM_FREE) s += "interval = " + interval(p) + ", ";
  if (p.unit[0]) s += "unit = " + escaped(p.unit) + ", ";
  return s + "state = \"" + state_text(p.state) + "\" }\n";
}

std::string effect_text(const driveid_effect_use &use) {
  std::string s = "\n[[effect]]\nname = " + escaped(use.name) + "\n";
  if (use.formula[0]) s += "formula = " + escaped(use.formula) + "\nadds_to = " + escaped(use.adds_to) + "\n";
  for (uint32_t k = 0; k < use.params; k++) s += line(use.param[k]);
  return s;
}

std::string model_text(const driveid_model &model, const char *history) {
  std::string s = "format = 1\nstructure = " + escaped(driveid_structure_name(model.structure)) + "\n";
  for (uint32_t k = 0; k < model.params; k++) s += block(model.param[k]);
  for (uint32_t e = 0; e < model.effects; e++) s += effect_text(model.effect[e]);
  if (history && history[0]) s += std::string("\n") + history + "\n";
  return s;
}

}  // namespace

extern "C" driveid_status driveid_model_write(const driveid_model *model, const char *history, char **text) {
  if (!model || !text || !driveid_structure_name(model->structure)) return DRIVEID_ERR_ARGUMENT;
  try {
    *text = driveid::text_copy(model_text(*model, history));
    return DRIVEID_OK;
  } catch (const std::bad_alloc &) {
    return DRIVEID_ERR_MEMORY;
  }
}

extern "C" void driveid_text_free(char *text) { delete[] text; }
