// SPDX-License-Identifier: Apache-2.0
// One explanation, as data: explain writes it, improve and power read it.
#pragma once

#include <string>
#include <vector>

#include <driveid/diagnose.h>

#include <nlohmann/json.hpp>

#include "diagnose/explain_core.hpp"

namespace driveid::diagnose {

struct Value {
  std::string name, unit;
  double value = 0, lo = 0, hi = 0;
};

struct Ranked {
  std::string effect;
  bool accepted = false;
  double share = 0, confidence = 0, worth = 0;
  double lead = 0;                 // log-likelihood over the best other explanation
  double beyond = 0;               // share of what the general family below takes that the effect leaves
  std::string family;
  std::vector<Value> parameters;
  std::vector<std::string> ties;
  std::string why;                 // of a refusal
};

struct Explanation {
  std::string verdict = "nothing_missing", message;
  std::vector<Ranked> ranked;
  std::vector<Prepared> training, held_out;
  std::vector<Notice> notices;
  std::vector<Analysis> analysis;  // one per equation
  driveid_model model;             // with nominal values re-estimated
  driveid_model grown;             // and the accepted effects added (in place of those that they contain)
  nlohmann::ordered_json shape;    // null unless something unknown is left
  unsigned added = 0;              // effects of grown, at its end, that model has not
  bool cancelled = false;
};

// driveid_model_add, and what the new effect contains goes: coulomb does not stand beside stribeck.
driveid_status add_in_place(driveid_model &model, const char *effect, char *reason, std::size_t reason_size);

struct Options {
  int threads = 2;
  unsigned seed = 1;
  bool errors = true;              // simulate before and after (compare)
  std::vector<std::string> effects;
};

// the staircase of an explanation, fitted and compared at each step
nlohmann::ordered_json improve(const driveid_task &task, const Options &options, const Explanation &explanation);
Options options_of(const char *json);
// Explains a model on records; progress may be NULL.
Explanation explain(const driveid_model &model, const driveid_task &task, const Options &options);
nlohmann::ordered_json explanation_json(const Explanation &explanation, const driveid_task &task, const Options &options);
nlohmann::ordered_json next_record(const Explanation &explanation);
nlohmann::ordered_json head_json(const driveid_task &task, const Explanation &explanation);
nlohmann::ordered_json notices_json(const std::vector<Notice> &notices);
nlohmann::ordered_json parameters_json(const std::vector<Value> &parameters);

}  // namespace driveid::diagnose
