// SPDX-License-Identifier: Apache-2.0
#include "diagnose/explain_refine.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "diagnose/fit_core.hpp"

namespace driveid::diagnose {
namespace {

constexpr double kStrayed = 4;   // a value this many times away is another minimum, not a better value

bool strayed(double before, double after) { return !std::isfinite(after) || (before != 0 && (std::fabs(after) > kStrayed * std::fabs(before) || std::fabs(after) < std::fabs(before) / kStrayed)); }

const driveid_effect_use *use_of(const driveid_model &model, uint32_t first, const char *name, int which) {
  for (uint32_t e = first; e < model.effects; e++)
    if (!std::strcmp(model.effect[e].name, name) && which-- == 0) return &model.effect[e];
  return nullptr;
}

// The first member of an effect keeps its names, further ones carry _2, _3 (cogging of several orders); those of the user's own model are not meant.
void copy_values(Ranked &ranked, const driveid_model &model, uint32_t first) {
  for (Value &value : ranked.parameters)
    for (int which = 0; which < 4; which++) {
      const driveid_effect_use *use = use_of(model, first, ranked.effect.c_str(), which);
      for (uint32_t k = 0; use && k < use->params; k++) {
        const driveid_param &p = use->param[k];
        if (value.name != (which ? std::string(p.name) + "_" + std::to_string(which + 1) : std::string(p.name))) continue;
        value.value = p.value;
        value.lo = p.lo;
        value.hi = p.hi;
      }
    }
}

// Two-sided 95 % for each of `among` statements at once.
double simultaneous(std::size_t among) {
  double lo = 1.9, hi = 8;
  for (int k = 0; k < 60; ++k) {
    const double z = 0.5 * (lo + hi);
    (std::erfc(z / std::sqrt(2.0)) > 0.05 / double(among) ? lo : hi) = z;
  }
  return lo;
}

}  // namespace

double widen_for_choice(Explanation &x) {
  std::size_t among = 1;
  for (const Analysis &a : x.analysis) among = std::max(among, a.search->candidates().size());
  const double by = simultaneous(among) / simultaneous(1);
  const auto widen = [by](double value, double &lo, double &hi) { lo = value - by * (value - lo), hi = value + by * (hi - value); };
  for (Ranked &r : x.ranked)
    for (Value &v : r.parameters) widen(v.value, v.lo, v.hi);
  for (uint32_t e = x.grown.effects - x.added; e < x.grown.effects; e++)
    for (uint32_t k = 0; k < x.grown.effect[e].params; k++)
      if (driveid_param &p = x.grown.effect[e].param[k]; p.lo < p.hi) widen(p.value, p.lo, p.hi);
  char text[160];
  std::snprintf(text, sizeof text, "intervals of found effects are widened by %.2f: each was chosen among %zu by the same data", by, among);
  x.notices.push_back({"chosen", text, ""});
  return by;
}

void refine_ranked(Explanation &x) {
  std::vector<const Equation *> equations;
  for (const Analysis &a : x.analysis) equations.push_back(&a.search->equation());
  driveid_model refined = x.grown;
  const uint32_t first = x.grown.effects - x.added;
  refine_values(refined, first, x.training, equations);
  for (uint32_t e = first; e < refined.effects; e++)
    for (uint32_t k = 0; k < refined.effect[e].params; k++) {
      driveid_param &p = refined.effect[e].param[k];
      if (!is_phase(p.name) && strayed(x.grown.effect[e].param[k].value, p.value)) return;
      reconcile(p, x.grown.effect[e].param[k]);
    }
  x.grown = refined;
  for (Ranked &r : x.ranked)
    if (r.accepted) copy_values(r, refined, first);
}

}  // namespace driveid::diagnose
