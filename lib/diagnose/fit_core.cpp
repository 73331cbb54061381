// SPDX-License-Identifier: Apache-2.0
#include "diagnose/fit_core.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <optional>

#include "diagnose/compare_core.hpp"
#include "diagnose/fit_lti.hpp"
#include "diagnose/fit_score.hpp"
#include "diagnose/floor.hpp"
#include "diagnose/plausible.hpp"

namespace driveid::diagnose {

namespace {

// ---- free parameters of a part ----

bool electrical_name(const std::string &n) { return n == "R_ohm" || n == "L_H" || n == "K_e_Vs_rad" || n == "L_d_H" || n == "L_q_H" || n == "psi_pm_Vs"; }

bool effect_in(const driveid_model &model, const driveid_effect_use &use, driveid_sim_mode mode) {
  const driveid_structure s = model.structure;
  const bool voltage = (s == DRIVEID_STRUCTURE_DC_DRIVE || s == DRIVEID_STRUCTURE_DC_CIRCUIT || s == DRIVEID_STRUCTURE_PMSM_DRIVE) && driveid_model_frame(&model) != DRIVEID_FRAME_VOLT;
  if (use.formula[0]) return !voltage || (std::strcmp(use.adds_to, "v_V") == 0) == (mode == DRIVEID_SIM_ELECTRICAL);
  const driveid_effect_info *info = driveid_effect_find(use.name);
  if (!info) return false;
  if (voltage && (std::strcmp(use.name, "delay") == 0 || (std::strcmp(use.name, "dead_zone") == 0 && s != DRIVEID_STRUCTURE_PMSM_DRIVE))) return mode == DRIVEID_SIM_ELECTRICAL;
  return info->domains & (mode == DRIVEID_SIM_ELECTRICAL ? DRIVEID_EFFECT_ELECTRICAL : DRIVEID_EFFECT_MECHANICAL);
}

batch::FreeParam free_of(const driveid_param &p, int effect, int index) {
  batch::FreeParam f;
  f.effect = effect;
  f.index = index;
  const double sd = (p.hi - p.lo) / 3.92, size = std::fabs(p.value);
  f.scale = std::isfinite(sd) && sd > 0 ? std::clamp(0.1 * sd, 1e-6 * size, 1e-2 * size + 1e-12) : 1e-4 * size;
  if (!(f.scale > 0)) f.scale = 1e-9;
  return f;
}

// Orders and instants are found by the search and stay: the simulation is not smooth in an instant, and an order is a whole number.
bool stays(const driveid_effect_info *info, uint32_t k) {
  if (!info || k >= info->params) return false;
  const std::string symbol = info->param[k].symbol;
  return info->param[k].dimension == DRIVEID_DIM_ORDER || symbol == "t_step" || symbol == "p" || symbol == "T_th" || symbol == "T_w";
}

std::vector<batch::FreeParam> free_params(const driveid_model &model, driveid_sim_mode mode) {
  std::vector<batch::FreeParam> out;
  for (uint32_t k = 0; k < model.params; k++) {
    const driveid_param &p = model.param[k];
    if (p.state != DRIVEID_PARAM_FREE) continue;
    if (model.structure != DRIVEID_STRUCTURE_LTI && mode != DRIVEID_SIM_WHOLE && electrical_name(p.name) != (mode == DRIVEID_SIM_ELECTRICAL)) continue;
    batch::FreeParam f = free_of(p, -1, int(k));
    const bool positive = p.name[0] == 'J' || p.name[0] == 'm' || p.name[0] == 'L' || p.name[0] == 'R' || p.name[0] == 'k';
    if (positive && model.structure != DRIVEID_STRUCTURE_LTI) f.lo = 1e-3 * std::fabs(p.value);
    out.push_back(f);
  }
  for (uint32_t e = 0; e < model.effects; e++) {
    const driveid_effect_use &use = model.effect[e];
    const driveid_effect_info *info = driveid_effect_find(use.name);
    if (!effect_in(model, use, mode)) continue;
    for (uint32_t k = 0; k < use.params; k++) {
      if (use.param[k].state != DRIVEID_PARAM_FREE || stays(info, k)) continue;
      batch::FreeParam f = free_of(use.param[k], int(e), int(k));
      if (info && info->param[k].lo == 0.0) f.lo = 0.0;
      if (info && (info->param[k].dimension == DRIVEID_DIM_LENGTH || info->param[k].dimension == DRIVEID_DIM_SPEED || info->param[k].dimension == DRIVEID_DIM_STIFFNESS)) f.lo = 1e-3 * std::fabs(use.param[k].value);
      out.push_back(f);
    }
  }
  return out;
}

driveid_param &param_of(driveid_model &model, const batch::FreeParam &f) { return f.effect < 0 ? model.param[f.index] : model.effect[f.effect].param[f.index]; }

constexpr double kNumerical = 3e-5;   // no interval is narrower than what the simulation's own steps are good for

void write_intervals(driveid_model &model, const std::vector<batch::FreeParam> &free, const batch::OutputErrorResult &result) {
  const double t = result.quantile;
  for (std::size_t k = 0; k < free.size(); k++) {
    driveid_param &p = param_of(model, free[k]);
    const double half = std::max(t * std::sqrt(std::max(0.0, result.covariance(Eigen::Index(k), Eigen::Index(k)))), kNumerical * std::fabs(p.value));
    p.lo = p.value - half;
    p.hi = p.value + half;
  }
}

// ---- refinement of one part ----

constexpr double kFilteredSpeed = 3;   // samples that a logged speed may be late by its own filter

struct Objective {
  double window_s = -1;       // -1: equation
  bool whiten = false;
};

struct Trial {
  std::string name;
  Objective objective;
  driveid_model model;
  double score = INFINITY;    // mean log of held-out errors
};

struct Data {
  bool free_skew = false;
  std::vector<batch::Stretch> training, judged;   // judged: kept aside
};

batch::Stretch cut_out(const batch::Stretch &s, std::size_t from, std::size_t to) {
  auto part = [&](const std::vector<double> &v) { return std::vector<double>(v.begin() + std::ptrdiff_t(from), v.begin() + std::ptrdiff_t(to)); };
  batch::Stretch out;
  out.hold = s.hold;
  out.skew_s = s.skew_s;
  std::copy(std::begin(s.noise), std::end(s.noise), out.noise);
  out.t_s = part(s.t_s);
  for (int c = 0; c < DRIVEID_SIGNAL_COUNT; c++)
    if (!s.column[c].empty()) out.column[c] = part(s.column[c]);
  return out;
}

// Held-out records judge; without them the last 30 % of the training stretches do, and in a second turn the first 30 %.
std::vector<Data> folds(const std::vector<batch::Stretch> &training, const std::vector<batch::Stretch> &held_out) {
  if (!held_out.empty()) return {Data{false, training, held_out}};
  std::vector<Data> out(2);
  for (const batch::Stretch &s : training) {
    const std::size_t n = s.t_s.size(), third = n * 3 / 10;
    if (n < 600) {
      out[0].training.push_back(s);
      out[1].training.push_back(s);
      continue;
    }
    out[0].training.push_back(cut_out(s, 0, n - third));
    out[0].judged.push_back(cut_out(s, n - third, n));
    out[1].training.push_back(cut_out(s, third, n));
    out[1].judged.push_back(cut_out(s, 0, third));
  }
  if (out[0].judged.empty()) out.resize(1);
  return out;
}

std::vector<const batch::Stretch *> pointers(const std::vector<batch::Stretch> &list, std::size_t rows_max) {
  std::size_t rows = 0;
  std::vector<const batch::Stretch *> out;
  for (const batch::Stretch &s : list) {
    if (!out.empty() && rows + s.t_s.size() > rows_max) continue;
    out.push_back(&s);
    rows += s.t_s.size();
  }
  return out;
}

std::optional<batch::OutputErrorResult> refine(const driveid_model &model, const Part &part, const std::vector<batch::Stretch> &data, const Objective &objective, const std::vector<batch::FreeParam> &free, int iterations, bool free_skew = false) {
  batch::OutputErrorProblem problem;
  problem.model = model;
  problem.mode = part.mode;
  problem.free = free;
  problem.outputs = part.outputs;
  problem.stretches = pointers(data, 150000);
  problem.window_s = objective.window_s;
  problem.whiten = objective.whiten;
  problem.free_skew = free_skew && objective.whiten;
  problem.free_motion = part.mode == DRIVEID_SIM_ELECTRICAL;
  const bool from_speed = !data.empty() && data[0].column[DRIVEID_SIGNAL_THETA_RAD].empty() && data[0].column[DRIVEID_SIGNAL_X_M].empty();
  if (from_speed && part.mode == DRIVEID_SIM_MECHANICAL) problem.most_skew = kFilteredSpeed, problem.most_blur = 0.5 * kFilteredSpeed;
  problem.iterations = iterations;
  batch::OutputErrorResult r = batch::fit_output_error(problem);
  if (!r.ok) return std::nullopt;
  return r;
}

constexpr double kFreeRun = 0.7;      // what a free run counts beside windows of a second

double judge(const driveid_model &model, const Part &part, const std::vector<batch::Stretch> &judged) {
  double sum = 0, count = 0;
  for (const batch::Stretch &s : judged)
    for (driveid_signal signal : part.judged_outputs) {
      const double free_run = score_windows(model, s, part.judged_mode, signal, 0), second = score_windows(model, s, part.judged_mode, signal, 1.0);
      if (!(free_run >= 0) || !(second >= 0)) return INFINITY;
      sum += kFreeRun * std::log(free_run + 1e-300) + (1 - kFreeRun) * std::log(second + 1e-300);
      count += 1;
    }
  return count > 0 ? sum / count : 0;
}

std::string name_of(const Objective &o) {
  const char *white = o.whiten ? ", whitened" : "";
  char text[60];
  if (o.window_s == 0) std::snprintf(text, sizeof text, "free run%s", white);
  else std::snprintf(text, sizeof text, "windows of %.3g s%s", o.window_s, white);
  return text;
}

constexpr double kAsGood = 0.15;     // objectives whose errors on kept-aside stretches differ by less (log) predict alike
constexpr double kTwice = 0.7;       // log
constexpr double kWorthIt = 0.10;    // an objective without honest intervals must predict kept-aside stretches that much better

constexpr double kUpset = 2;          // times the least error of the balance
constexpr double kLeaves = 2;         // half-widths
constexpr double kDerivatives = 0.5;  // agreement of steps up and down, below which a window is too long for a simulation that sticks and slips with a noisy input

double balance_error(const EquationSet &set, bool electrical, const driveid_model &model) {
  double squares = 0;
  for (const Equation &e : set.equation)
    if (e.electrical == electrical) squares += equation_residual(e, model).squaredNorm();
  return std::sqrt(squares);
}

// The longest of the whitened objectives that predict about as well as the best of them.
const Trial *choose_local(const std::vector<Trial> &trials) {
  double best = INFINITY;
  for (const Trial &t : trials)
    if (t.objective.whiten) best = std::min(best, t.score);
  const Trial *chosen = nullptr;
  for (const Trial &t : trials)
    if (t.objective.whiten && t.score <= best + kAsGood && std::isfinite(t.score)) chosen = &t;
  return chosen;
}

// A free run of a model that lacks much follows by values that are no drive's: those that upset the balance are not taken.
const Trial *choose(const std::vector<Trial> &trials, const EquationSet &set, bool electrical, double limit) {
  const Trial *chosen = choose_local(trials);
  for (const Trial &t : trials) {
    if (t.objective.whiten || !std::isfinite(t.score) || (chosen && t.score >= chosen->score - kWorthIt)) continue;
    if (chosen && balance_error(set, electrical, t.model) > limit) continue;
    chosen = &t;
  }
  return chosen;
}

// A long run's residual never forgets, so its own covariance is too narrow: the interval reaches at least as far as the local fit's, and as its value.
void widen_intervals(driveid_model &model, const std::vector<batch::FreeParam> &free, const driveid_model &local) {
  driveid_model other = local;
  for (const batch::FreeParam &f : free) {
    driveid_param &p = param_of(model, f);
    const driveid_param &q = param_of(other, f);
    const double half = std::max({p.hi - p.value, q.hi - q.value, std::fabs(p.value - q.value)});
    p.lo = p.value - half;
    p.hi = p.value + half;
  }
}

// Another value than the whitened fit's tells of an imperfect model only where its interval is left behind.
bool leaves(const driveid_model &model, const driveid_model &local, const std::vector<batch::FreeParam> &free) {
  driveid_model a = model, b = local;
  for (const batch::FreeParam &f : free)
    if (std::fabs(param_of(a, f).value - param_of(b, f).value) > kLeaves * (param_of(b, f).hi - param_of(b, f).value)) return true;
  return false;
}

// Every objective on one division of the data, each started from the one before where that predicts well.
std::vector<Trial> try_objectives(FitOutcome &outcome, const Part &part, const Data &data, const std::vector<batch::FreeParam> &free, const FitOptions &options) {
  std::vector<Trial> trials{{"equation", {}, outcome.model, judge(outcome.model, part, data.judged)}};
  double longest = 0;
  for (const batch::Stretch &s : data.training) longest = std::max(longest, s.t_s.back() - s.t_s.front());
  std::vector<Objective> objectives{{0.3, true}, {1.0, true}, {4.0, true}, {0.0, false}};
  if (options.window_s >= 0) objectives = {{options.window_s, options.whiten}}, trials.clear();
  driveid_model start = outcome.model;
  if (options.tick && !options.tick(0.25, "refine")) {
    outcome.cancelled = true;
    return trials;
  }
  if (const auto near = refine(start, part, data.training, {0.2, false}, free, 8)) {   // short windows forgive a poor start
    const double equation = judge(outcome.model, part, data.judged);
    if (judge(near->model, part, data.judged) < equation) start = near->model;
  }
  for (const Objective &objective : objectives) {
    const double window = objective.window_s;
    if (window > 0.6 * longest && options.window_s < 0) continue;
    if (options.tick && !options.tick(window == 0 ? 0.7 : 0.3 + 0.07 * window, "refine")) {
      outcome.cancelled = true;
      return trials;
    }
    const auto r = refine(start, part, data.training, objective, free, 12, data.free_skew);
    if (!r || (r->agreement < kDerivatives && options.window_s < 0 && part.mode != DRIVEID_SIM_ELECTRICAL)) continue;   // a circuit does not stick
    Trial t{name_of(objective), objective, r->model, judge(r->model, part, data.judged)};
    if (trials.empty() || t.score < trials.back().score + 0.5) start = t.model;
    trials.push_back(t);
  }
  return trials;
}

// An objective that failed in one turn is out.
void add_scores(std::vector<Trial> &trials, const std::vector<Trial> &turn) {
  for (Trial &t : trials) {
    double second = INFINITY;
    for (const Trial &u : turn)
      if (u.name == t.name) second = u.score;
    t.score = 0.5 * (t.score + second);
  }
}

// The balance's own answer, where it and the simulation exclude each other (an input read with the wrong hold, a force that neither knows).
void contradicted(driveid_param &simulated, const driveid_param &balanced) {
  const double own = 0.5 * (simulated.hi - simulated.lo), other = 0.5 * (balanced.hi - balanced.lo);
  if (!is_phase(simulated.name) && std::isfinite(other) && std::fabs(simulated.value - balanced.value) > own + other) reconcile(simulated, balanced);
}

void refine_part(FitOutcome &outcome, const Part &part, const std::vector<batch::Stretch> &training, const std::vector<batch::Stretch> &held_out, bool free_skew, const EquationSet &set, const FitOptions &options) {
  const std::vector<batch::FreeParam> free = free_params(outcome.model, part.mode);
  if (free.empty() || training.empty()) return;
  const driveid_model balanced = outcome.model;
  for (const batch::FreeParam &f : free)   // a balance may leave an inductance below nothing; a simulation cannot start there
    if (driveid_param &p = param_of(outcome.model, f); f.lo > 0 && p.value < f.lo) p.value = std::fabs(p.value);
  std::vector<Trial> trials;
  for (Data &data : folds(training, held_out)) {
    data.free_skew = free_skew;
    const std::vector<Trial> turn = try_objectives(outcome, part, data, free, options);
    if (outcome.cancelled) return;
    if (trials.empty()) trials = turn;
    else add_scores(trials, turn);
  }
  const bool electrical = part.mode == DRIVEID_SIM_ELECTRICAL;
  double limit = balance_error(set, electrical, balanced);
  for (const Trial &t : trials) limit = std::min(limit, balance_error(set, electrical, t.model));
  limit *= kUpset;
  auto upset = [&](const driveid_model &model) { return balance_error(set, electrical, model) > limit; };   // also what the kept-aside stretches make of a trial
  const Trial *local = choose_local(trials), *chosen = choose(trials, set, electrical, limit);
  outcome.model = chosen ? outcome.model : balanced;
  if (!chosen) return;
  std::optional<driveid_model> honest;
  auto fitted = [&](const Trial &trial) -> std::optional<driveid_model> {   // with the kept-aside stretches of the training records
    const auto r = refine(trial.model, part, training, trial.objective, free, 16, free_skew);
    if (!r) return std::nullopt;
    driveid_model model = r->model;
    write_intervals(model, free, *r);
    return model;
  };
  if (local) honest = fitted(*local);
  std::optional<driveid_model> best = honest;
  if (chosen != local) {
    best = chosen->objective.window_s < 0 ? balanced : fitted(*chosen);
    if (best && upset(*best)) best = balanced;
    if (best && honest && !upset(*honest) && !leaves(*best, *honest, free)) best = honest, chosen = local;
    else if (best && honest) widen_intervals(*best, free, *honest);
  }
  driveid_model other = balanced;
  if (best && chosen == local)
    for (const batch::FreeParam &f : free) contradicted(param_of(*best, f), param_of(other, f));
  if (best) outcome.model = *best;
  outcome.objective += (outcome.objective.empty() ? "" : ", ") + chosen->name;
}

std::vector<batch::Stretch> all_stretches(const driveid_model &model, const std::vector<Prepared> &records, const EquationSet &set, driveid_sim_mode mode) {
  std::vector<batch::Stretch> out;
  for (const Prepared &r : records)
    for (batch::Stretch &s : make_stretches(model, r, timing_of(set, r, mode))) out.push_back(std::move(s));
  return out;
}

// A skew is a nuisance where the hold was not told and no delay stands in the model.
bool skew_unknown(const driveid_model &model, const Prepared &record, const Part &part) {
  for (uint32_t e = 0; e < model.effects; e++)
    if (std::strcmp(model.effect[e].name, "delay") == 0) return false;
  return record.hold.empty() && part.mode != DRIVEID_SIM_WHOLE;
}

std::string unfit(const driveid_model &model, const std::vector<Part> &parts) {
  for (const Part &part : parts)
    for (uint32_t k = 0; k < model.params; k++) {
      const driveid_param &p = model.param[k];
      if ((p.name[0] == 'J' || p.name[0] == 'm') && part.mode == DRIVEID_SIM_MECHANICAL && p.state == DRIVEID_PARAM_FREE && !(p.value > 0))
        return std::string(p.name) + " came out negative: a column has the wrong sign (map it with a minus), the motion has too little acceleration, or a force that goes with the place is missing (driveid explain finds it)";
    }
  return "";
}

void equation_stage(FitOutcome &outcome, EquationSet &set, const FitOptions &options) {
  for (Equation &e : set.equation) {
    find_floor(e, make_families(e));
    if (!fit_equation(e, outcome.model, options.threads, outcome.notices)) outcome.notices.push_back({"fit", "the " + e.signal + " equation could not be solved", ""});
  }
}

}  // namespace

bool is_phase(const char *name) { return !std::strncmp(name, "phi", 3) || !std::strncmp(name, "theta_0", 7); }

void reconcile(driveid_param &refined, const driveid_param &found) {
  const double turn = 6.283185307179586, away = is_phase(refined.name) ? std::fabs(std::remainder(refined.value - found.value, turn)) : std::fabs(refined.value - found.value);
  const double own = 0.5 * (refined.hi - refined.lo), other = 0.5 * (found.hi - found.lo);
  const double half = away > own + other ? away + other : std::max(own, other);
  refined.lo = refined.value - half;
  refined.hi = refined.value + half;
}

void refine_values(driveid_model &model, uint32_t first_effect, const std::vector<Prepared> &training, const std::vector<const Equation *> &equations) {
  if (training.empty()) return;
  for (const Part &part : parts_of(model, training[0])) {
    bool grown = false;
    for (uint32_t e = first_effect; e < model.effects; e++) grown |= effect_in(model, model.effect[e], part.mode);
    if (!grown) continue;
    std::vector<batch::Stretch> data;
    for (const Prepared &r : training)
      for (batch::Stretch &s : make_stretches(model, r, timing_of(equations, r, part.mode))) data.push_back(std::move(s));
    const std::vector<batch::FreeParam> free = free_params(model, part.mode);
    if (data.empty() || free.empty()) continue;
    const auto near = refine(model, part, data, {0.3, false}, free, 6);
    const driveid_model start = near ? near->model : model;
    std::optional<batch::OutputErrorResult> best;
    double least = INFINITY;
    for (const Objective &objective : {Objective{2.0, true}, Objective{0.3, true}, Objective{0.0, false}}) {   // honest intervals first; others where they predict twice as well
      if (best && objective.whiten) continue;
      const auto fitted = refine(start, part, data, objective, free, 10, skew_unknown(model, training[0], part));
      if (!fitted || fitted->agreement < kDerivatives) continue;
      const double score = judge(fitted->model, part, data);
      if (best && score > least - kTwice) continue;
      best = fitted;
      least = score;
    }
    if (near && near->agreement >= kDerivatives && judge(near->model, part, data) < least - kTwice) best = near;
    if (!best) continue;
    model = best->model;
    write_intervals(model, free, *best);
  }
}

FitOutcome fit_model(const driveid_model &model, const std::vector<Prepared> &training, const std::vector<Prepared> &held_out, const FitOptions &options) {
  FitOutcome outcome;
  outcome.model = model;
  if (training.empty()) {
    outcome.bad = "no record to fit to";
    return outcome;
  }
  for (const Prepared &p : training)
    if (!p.bad.empty()) {
      outcome.bad = p.name + ": " + p.bad;
      return outcome;
    }
  if (!adopt_frame(outcome.model, training[0], outcome.bad)) return outcome;
  EquationSet set;
  if (model.structure == DRIVEID_STRUCTURE_LTI) {
    if (!start_lti(outcome.model, training, outcome.bad)) return outcome;
  } else {
    set = make_equations(outcome.model, training, {});
    outcome.notices = set.notices;
    outcome.bad = set.bad.empty() ? opposed(set, training, {}) : set.bad;
    if (!outcome.bad.empty()) return outcome;
    for (Notice &n : implausible(set, outcome.model, "")) outcome.notices.push_back(std::move(n));
    if (options.tick && !options.tick(0.1, "equations")) { outcome.cancelled = true; return outcome; }
    equation_stage(outcome, set, options);
  }
  const std::vector<Part> parts = parts_of(outcome.model, training[0]);
  outcome.bad = unfit(outcome.model, parts);
  if (!outcome.bad.empty() || !options.refine) return outcome;
  for (const Part &part : parts) {
    refine_part(outcome, part, all_stretches(outcome.model, training, set, part.mode), all_stretches(outcome.model, held_out, set, part.mode), skew_unknown(outcome.model, training[0], part), set, options);
    if (outcome.cancelled) return outcome;
  }
  return outcome;
}

}  // namespace driveid::diagnose
