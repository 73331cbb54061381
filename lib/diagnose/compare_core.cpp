// SPDX-License-Identifier: Apache-2.0
#include "diagnose/compare_core.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "diagnose/explain_candidate.hpp"
#include "diagnose/fit_score.hpp"
#include "diagnose/floor.hpp"
#include "diagnose/locate.hpp"
#include "diagnose/plausible.hpp"

namespace driveid::diagnose {

using nlohmann::ordered_json;

namespace {

double value_in(const driveid_model &model, const std::string &name) {
  const driveid_param *p = driveid_model_param(&model, name.c_str());
  return p && p->state != DRIVEID_PARAM_UNSET ? p->value : 0.0;
}

Eigen::VectorXd linear_of(const Equation &e, const Candidate &c, const std::vector<double> &p) {
  if (c.name == "compliance") return Eigen::VectorXd::Constant(1, p[0]);
  if (c.name == "backlash") return Eigen::VectorXd::Constant(1, p[1]);
  if (c.name == "encoder_eccentricity") return Eigen::Vector2d(p[0] * std::cos(p[1]), p[0] * std::sin(p[1]));
  double shape[DRIVEID_EFFECT_SHAPES_MAX] = {}, linear[DRIVEID_EFFECT_COLUMNS_MAX] = {};
  driveid_effect_resolve(c.info, p.data(), e.gain, shape, linear);
  return Eigen::Map<Eigen::VectorXd>(linear, c.info->columns);
}

void take_off(const Equation &e, const Candidate &c, const std::vector<double> &shape, const Eigen::VectorXd &linear, const Nominal &nominal, Eigen::VectorXd &residual) {
  const Term t = realise(e, c, shape, nominal);
  if (t.taken.size()) residual -= t.taken;
  if (t.column.cols() && t.column.cols() == linear.size()) residual -= t.column * linear;
}

void take_own(const Equation &e, const driveid_effect_use &use, const Nominal &nominal, Eigen::VectorXd &residual) {
  std::string error;
  const Candidate c = own_candidate(use, error);
  driveid_formula f;
  if (!error.empty() || driveid_formula_parse(use.formula, &f, nullptr, 0)) return;
  std::vector<double> shape, linear;
  for (uint32_t k = 0; k < f.params; k++) (f.linear_mask >> k & 1u ? linear : shape).push_back(use.param[k].value);
  take_off(e, c, shape, Eigen::Map<Eigen::VectorXd>(linear.data(), Eigen::Index(linear.size())), nominal, residual);
}

std::vector<double> params_of(const driveid_effect_use &use) {
  std::vector<double> p;
  for (uint32_t k = 0; k < use.params; k++) p.push_back(use.param[k].value);
  return p;
}

}  // namespace

Eigen::VectorXd equation_residual(const Equation &e, const driveid_model &model) {
  Eigen::VectorXd residual = e.y;
  Nominal nominal;
  Eigen::Index column = 0;
  for (const BaseColumn &b : e.base_column) {
    const double value = b.given ? b.value : value_in(model, b.name);
    if (!e.electrical && (b.name[0] == 'J' || b.name[0] == 'm')) nominal.inertia = value;
    if (!e.electrical && (b.name[0] == 'B' || b.name[0] == 'b')) nominal.damping = value;
    if (!b.given) residual -= value * e.base.col(column++);
  }
  const std::vector<Candidate> candidates = make_candidates(e);
  auto find = [&](const char *name) -> const Candidate * {
    for (const Candidate &c : candidates)
      if (c.name == name) return &c;
    return nullptr;
  };
  for (uint32_t k = 0; k < model.effects; k++) {
    const driveid_effect_use &use = model.effect[k];
    if (use.formula[0]) {
      if ((std::strcmp(use.adds_to, "v_V") == 0) == (e.electrical || e.drive_unit == 'V')) take_own(e, use, nominal, residual);
      continue;
    }
    const Candidate *c = find(use.name);
    if (!c) continue;
    const std::vector<double> p = params_of(use);
    take_off(e, *c, shape_of(e, *c, p), linear_of(e, *c, p), nominal, residual);
  }
  if (model.structure == DRIVEID_STRUCTURE_TWO_MASS_AXIS && !e.electrical)
    if (const Candidate *c = find("compliance")) {
      const bool per_ampere = driveid_model_param(&model, "J_l_As2_rad") != nullptr;
      const std::vector<double> p{value_in(model, per_ampere ? "J_l_As2_rad" : "J_l_kgm2"), value_in(model, per_ampere ? "k_A_rad" : "k_Nm_rad"), value_in(model, per_ampere ? "d_As_rad" : "d_Nms_rad")};
      const Eigen::VectorXd load = Eigen::VectorXd::Constant(1, p[0]);
      residual -= p[0] * e.base.col(0);   // the base column is the whole inertia's
      take_off(e, *c, shape_of(e, *c, p), load, nominal, residual);
    }
  return residual;
}

// ---- tests ----

namespace {

constexpr double kBound = 3.0;   // standard deviations: one false alarm in some forty records of nine tests

ResidualTest tested(const std::string &name, double statistic) { return {name, statistic, kBound, std::fabs(statistic) <= kBound}; }

// Largest correlation of the whitened residual with a handful of functions, in standard deviations of chance, corrected for their number.
double dependence(const Equation &e, const Eigen::VectorXd &white, const std::vector<FineSignal> &functions) {
  double most = 0;
  for (const FineSignal &f : functions) {
    Eigen::VectorXd x = whiten(e, stack(e, f, 0));
    double n = 0, mean = 0;
    for (Eigen::Index k = 0; k < x.size(); k++) n += e.weight[std::size_t(k)], mean += e.weight[std::size_t(k)] * x[k];
    if (n < 30) continue;
    mean /= n;
    for (Eigen::Index k = 0; k < x.size(); k++) x[k] = e.weight[std::size_t(k)] * (x[k] - mean);
    const double size = x.norm() * white.norm();
    if (size > 0) most = std::max(most, std::fabs(x.dot(white)) / size * std::sqrt(n));
  }
  if (functions.size() < 2) return most;
  const double tail = std::min(0.999, double(functions.size()) * std::erfc(most / std::sqrt(2.0)));   // Bonferroni, back to one deviate
  double lo = 0, hi = 40;
  for (int k = 0; k < 60; k++) (std::erfc(0.5 * (lo + hi) / std::sqrt(2.0)) > tail ? lo : hi) = 0.5 * (lo + hi);
  return lo;
}

double whiteness(const Equation &e, const Eigen::VectorXd &white) {
  const int lags = 20;
  double q = 0, n = 0, c0 = 0;
  for (Eigen::Index k = 0; k < white.size(); k++) n += e.weight[std::size_t(k)] > 0, c0 += white[k] * white[k];
  if (n < 100 || !(c0 > 0)) return 0;
  for (int lag = 1; lag <= lags; lag++) {
    double c = 0;
    for (Eigen::Index k = lag; k < white.size(); k++)
      if (e.weight[std::size_t(k)] > 0 && e.weight[std::size_t(k - lag)] > 0) c += white[k] * white[k - lag];
    q += n * (c / c0) * (c / c0);
  }
  return (q - lags) / std::sqrt(2.0 * lags);   // Box-Pierce, as a deviate
}

FineSignal of_state(double (*f)(const driveid_effect_state &)) {
  return [f](const Track &t, std::vector<double> &x) {
    x.resize(t.state.size());
    for (std::size_t k = 0; k < x.size(); k++) x[k] = f(t.state[k]);
  };
}

}  // namespace

std::vector<ResidualTest> residual_tests(const Equation &e, const Eigen::VectorXd &residual) {
  Eigen::VectorXd white = whiten(e, residual);
  for (Eigen::Index k = 0; k < white.size(); k++) white[k] *= e.weight[std::size_t(k)];
  std::vector<ResidualTest> out{tested("whiteness", whiteness(e, white))};
  const std::string input = e.electrical ? "voltage" : "input";
  out.push_back(tested("independence of the " + input, dependence(e, white, {of_state([](const driveid_effect_state &s) { return s.drive; }), of_state([](const driveid_effect_state &s) { return s.drive * std::fabs(s.drive); })})));
  std::vector<FineSignal> turn;
  for (int order = 1; order <= 6; order++)
    for (int q = 0; q < 2; q++)
      turn.push_back([order, q](const Track &t, std::vector<double> &x) {
        x.resize(t.state.size());
        for (std::size_t k = 0; k < x.size(); k++) x[k] = q ? std::cos(order * t.state[k].angle) : std::sin(order * t.state[k].angle);
      });
  const bool rotary = e.frame != DRIVEID_FRAME_FORCE && e.frame != DRIVEID_FRAME_AMPERE_LINEAR;
  if (rotary) out.push_back(tested("independence of theta", dependence(e, white, turn)));
  else out.push_back(tested("independence of x", dependence(e, white, {of_state([](const driveid_effect_state &s) { return s.angle; }), of_state([](const driveid_effect_state &s) { return s.angle * s.angle; })})));
  out.push_back(tested("independence of |omega|", dependence(e, white, {of_state([](const driveid_effect_state &s) { return std::fabs(s.speed); }), of_state([](const driveid_effect_state &s) { return s.speed * std::fabs(s.speed); })})));
  out.push_back(tested("independence of sign(omega)", dependence(e, white, {of_state([](const driveid_effect_state &s) { return s.direction; })})));
  const bool current = e.electrical || e.drive_unit == 'A';
  if (current) out.push_back(tested("independence of the current", dependence(e, white, {of_state([](const driveid_effect_state &s) { return s.current_A; }), of_state([](const driveid_effect_state &s) { return s.current_A * std::fabs(s.current_A); }), of_state([](const driveid_effect_state &s) { return double((s.current_A > 0) - (s.current_A < 0)); })})));
  bool temperature = false;
  for (const Track &t : e.tracks)
    for (const driveid_effect_state &s : t.state) temperature = temperature || s.has_temperature;
  if (temperature) out.push_back(tested("independence of the temperature", dependence(e, white, {of_state([](const driveid_effect_state &s) { return s.T_degC; }), of_state([](const driveid_effect_state &s) { return s.T_degC * s.direction; }), of_state([](const driveid_effect_state &s) { return s.T_degC * s.current_A; })})));
  return out;
}

// ---- one record ----

namespace {

double spread(const std::vector<double> &v) {
  double mean = 0, sum = 0;
  for (double x : v) mean += x;
  mean /= double(std::max<std::size_t>(1, v.size()));
  for (double x : v) sum += (x - mean) * (x - mean);
  return std::sqrt(sum / double(std::max<std::size_t>(1, v.size())));
}

const char *unit_of(driveid_signal signal) {
  switch (signal) {
    case DRIVEID_SIGNAL_THETA_RAD: case DRIVEID_SIGNAL_THETA_L_RAD: return "rad";
    case DRIVEID_SIGNAL_OMEGA_RAD_S: return "rad/s";
    case DRIVEID_SIGNAL_X_M: return "m";
    case DRIVEID_SIGNAL_V_M_S: return "m/s";
    case DRIVEID_SIGNAL_I_A: case DRIVEID_SIGNAL_I_D_A: case DRIVEID_SIGNAL_I_Q_A: return "A";
    default: return "";
  }
}

// A simulation's floor: below, the noise of the sensor itself; above, the error that is left when the part of the equation error that a flexible
// regression predicts is gone (the simulation error shrinks with the equation error that drives it).
void simulated(ErrorObject &o, const std::vector<batch::Stretch> &stretches, const std::vector<std::vector<double>> &predicted, driveid_signal signal, double noise, double share) {
  double squares = 0, rows = 0;
  std::vector<double> all;
  for (std::size_t k = 0; k < stretches.size(); k++) {
    const double r = rms_error(stretches[k].column[signal], predicted[k], 0);
    if (r < 0) return;
    squares += r * r * double(stretches[k].t_s.size());
    rows += double(stretches[k].t_s.size());
    all.insert(all.end(), stretches[k].column[signal].begin(), stretches[k].column[signal].end());
  }
  if (!(rows > 0)) return;
  o.rmse = std::sqrt(squares / rows);
  o.signal = driveid_signal_name(signal);
  o.unit = unit_of(signal);
  o.floor_lo = noise;
  o.floor_hi = std::max(noise, std::hypot(noise, share * o.rmse));
  const double size = spread(all);
  o.fit_percent = size > 0 ? 100 * (1 - o.rmse / size) : 0;
}

void add_where(const Equation &e, const Eigen::VectorXd &residual, const Floor &floor, ordered_json &where) {
  if (floor.flexible.size() != residual.size()) return;
  Eigen::MatrixXd gram = e.base.transpose() * e.base;   // what the flexible regression leaves of its own starting point, the bare structure
  gram.diagonal() *= 1 + 1e-12;
  const Eigen::VectorXd left = e.y - e.base * gram.ldlt().solve(e.base.transpose() * e.y) - floor.flexible;
  for (const Regime &r : locate(e, residual, left)) {
    if (where.size() >= 40) break;
    where.push_back({{"equation", e.signal}, {"axis", r.axis}, {"regime", r.text}, {"share", r.share}, {"rows", r.rows}, {"statistic", r.statistic}, {"bound", r.bound}, {"significant", r.significant}});
    if (r.lo < r.hi) where.back()["range"] = {r.lo, r.hi};
  }
}

// What even the model and a flexible regression together leave: with the model's own effects, and with the orders of the turn that it still misses.
double left_beside_model(Equation &e, const Eigen::VectorXd &residual, std::vector<Family> families) {
  constexpr std::size_t kOrders = 2;
  constexpr double kSure = 5, kInFamily = 8;   // deviations; the turn's family has the orders up to 8 already
  std::size_t orders = 0;
  for (const OrderLine &line : order_lines(e, residual))
    if (line.statistic > kSure && line.order > kInFamily && orders++ < kOrders) families.push_back(order_family(e, line.order));
  const Eigen::VectorXd measured = e.y;
  const auto ar = e.ar;
  const auto weight = e.weight;
  const auto mask = e.mask;
  const double motion = e.noise_motion, drive = e.noise_drive;
  e.y = residual;
  const double left = find_floor(e, families).hi;
  e.y = measured, e.ar = ar, e.weight = weight, e.mask = mask, e.noise_motion = motion, e.noise_drive = drive;   // the tests whiten as before
  return left;
}

void equation_errors(const driveid_model &model, EquationSet &set, Compared &out, double &share) {
  share = 1;
  for (Equation &e : set.equation) {
    const std::vector<Family> families = make_families(e);
    Floor floor = find_floor(e, families);
    const Eigen::VectorXd residual = equation_residual(e, model);
    floor.hi = std::min(floor.hi, left_beside_model(e, residual, families));
    ErrorObject o;
    o.rmse = std::sqrt(residual.squaredNorm() / double(std::max<std::size_t>(1, e.rows)));
    o.unit = e.unit;
    o.signal = e.signal;
    o.floor_lo = std::min(floor.lo, floor.hi);
    o.floor_hi = floor.hi;
    const double size = std::sqrt(e.y.squaredNorm() / double(std::max<std::size_t>(1, e.rows)));
    o.fit_percent = size > 0 ? 100 * (1 - o.rmse / size) : 0;
    const bool last = &e == &set.equation.back();
    if (last) out.errors.equation = o;
    share = o.rmse > 0 ? std::min(1.0, floor.hi / o.rmse) : 1;
    add_where(e, residual, floor, out.where);
    for (ResidualTest t : residual_tests(e, residual)) {
      if (set.equation.size() > 1) t.name = e.signal + ": " + t.name;
      out.tests.push_back(t);
    }
  }
}

}  // namespace

Compared compare_record(const driveid_model &model, const Prepared &record, bool quick, double floor_share) {
  Compared out;
  double share = floor_share;
  EquationSet set;
  if (model.structure != DRIVEID_STRUCTURE_LTI) {
    set = make_equations(model, {record}, {});
    if (!quick) {
      equation_errors(model, set, out, share);
      out.notices = implausible(set, model, record.name);
    }
  }
  const driveid_signal signal = scored_signal(model, record);
  if (signal == DRIVEID_SIGNAL_COUNT) return out;
  const driveid_sim_mode whole = whole_mode(model, record);
  const std::vector<batch::Stretch> stretches = make_stretches(model, record, timing_of(set, record, whole));
  std::vector<std::vector<double>> free, windows, step;
  for (const batch::Stretch &s : stretches) {
    free.push_back(predict_windows(model, s, whole, signal, 0));
    if (quick) continue;
    windows.push_back(predict_windows(model, s, whole, signal, 0.5));
    step.push_back(predict_one_step(model, s, whole, signal));
  }
  const auto q = record.quality.find(driveid_signal_name(signal));
  const double noise = q == record.quality.end() ? 0 : q->second.noise;
  simulated(out.errors.free_run, stretches, free, signal, noise, share);
  if (quick) return out;
  simulated(out.errors.windows, stretches, windows, signal, noise, share);
  simulated(out.errors.one_step, stretches, step, signal, noise, share);
  return out;
}

// ---- documents ----

ordered_json to_json(const ErrorObject &e) {
  if (e.rmse < 0) return nullptr;
  return {{"rmse", e.rmse}, {"unit", e.unit}, {"signal", e.signal}, {"noise_floor", {e.floor_lo, e.floor_hi}}, {"fit_percent", e.fit_percent}};
}

ordered_json to_json(const ErrorSet &s) { return {{"equation", to_json(s.equation)}, {"one_step", to_json(s.one_step)}, {"windows", to_json(s.windows)}, {"free_run", to_json(s.free_run)}}; }

ErrorSet together(const std::vector<ErrorSet> &sets, const std::vector<double> &rows) {
  ErrorSet out;
  auto mean = [&](ErrorObject ErrorSet::*which) {
    ErrorObject &o = out.*which;
    double n = 0, mse = 0, lo = 0, hi = 0, fit = 0;
    for (std::size_t k = 0; k < sets.size(); k++) {
      const ErrorObject &s = sets[k].*which;
      if (s.rmse < 0) continue;
      o = s;
      n += rows[k], mse += rows[k] * s.rmse * s.rmse, lo += rows[k] * s.floor_lo * s.floor_lo, hi += rows[k] * s.floor_hi * s.floor_hi, fit += rows[k] * s.fit_percent;
    }
    if (n > 0) o.rmse = std::sqrt(mse / n), o.floor_lo = std::sqrt(lo / n), o.floor_hi = std::sqrt(hi / n), o.fit_percent = fit / n;
  };
  mean(&ErrorSet::equation);
  mean(&ErrorSet::one_step);
  mean(&ErrorSet::windows);
  mean(&ErrorSet::free_run);
  return out;
}

ordered_json simulated_errors(const driveid_model &model, const std::vector<Prepared> &records, const ordered_json &equation) {
  if (records.empty()) return ordered_json::object();
  const double rmse = equation.value("rmse", 0.0), floor = equation.contains("noise_floor") ? equation["noise_floor"][1].get<double>() : rmse;
  const double share = rmse > 0 ? std::min(1.0, floor / rmse) : 1;
  std::vector<ErrorSet> sets;
  std::vector<double> rows;
  for (const Prepared &p : records) sets.push_back(compare_record(model, p, true, share).errors), rows.push_back(double(p.rows));
  ordered_json all = to_json(together(sets, rows));
  all.erase("equation");
  return all;
}

}  // namespace driveid::diagnose
