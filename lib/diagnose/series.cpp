// SPDX-License-Identifier: Apache-2.0
// Series for plots, on the rows of the record as it was given.
//
//   "theta_rad"            what "signal"      as measured
//   "theta_rad.free_run"   what "prediction"  free run from the start
//   "theta_rad.one_step"   what "prediction"  one sample ahead
//   "torque.equation"      what "residual"    what the balance leaves
#include <driveid/diagnose.h>

#include <algorithm>
#include <cmath>
#include <new>

#include <nlohmann/json.hpp>

#include "diagnose/compare_core.hpp"
#include "diagnose/fit_score.hpp"
#include "diagnose/fit_task.hpp"
#include "model/file/text.hpp"

namespace driveid::diagnose {
namespace {

using nlohmann::ordered_json;

struct Curve {
  std::string name, unit, what;
  std::vector<double> value;
};

// Values at increasing times, carried to the rows of the record; NaN where the next known instant is further than reach_s away.
struct Sampled {
  std::vector<double> t, value;
};

std::vector<double> on_rows(const driveid_record &record, const Sampled &s, double reach_s) {
  std::vector<double> out(record.rows, NAN);
  std::size_t k = 0;
  for (std::size_t row = 0; row < record.rows && !s.t.empty(); row++) {
    const double t = 1e-9 * double(record.t_ns[row] - record.t_ns[0]);
    while (k + 1 < s.t.size() && s.t[k + 1] <= t) k++;
    if (t < s.t[0] - reach_s || t > s.t.back() + reach_s) continue;
    if (k + 1 >= s.t.size() || t <= s.t[k]) {
      if (std::fabs(t - s.t[k]) <= reach_s) out[row] = s.value[k];
      continue;
    }
    const double span = s.t[k + 1] - s.t[k];
    if (span > 2 * reach_s) continue;
    out[row] = s.value[k] + (s.value[k + 1] - s.value[k]) * (t - s.t[k]) / span;
  }
  return out;
}

const char *unit_part(const std::string &name) {
  static const struct { const char *suffix, *unit; } units[] = {{"_rad_s", "rad/s"}, {"_m_s", "m/s"}, {"_rad", "rad"}, {"_Nm", "N m"}, {"_degC", "degC"}, {"_A", "A"}, {"_V", "V"}, {"_N", "N"}, {"_m", "m"}};
  for (const auto &u : units)
    if (name.size() > std::string(u.suffix).size() && name.compare(name.size() - std::string(u.suffix).size(), std::string::npos, u.suffix) == 0) return u.unit;
  return "";
}

void predictions(const driveid_model &model, const driveid_record &raw, const Prepared &record, const EquationSet &set, std::vector<Curve> &curves) {
  const driveid_signal signal = scored_signal(model, record);
  if (signal == DRIVEID_SIGNAL_COUNT) return;
  const driveid_sim_mode mode = whole_mode(model, record);
  Sampled free, step;
  for (const batch::Stretch &s : make_stretches(model, record, timing_of(set, record, mode))) {
    const std::vector<double> f = predict_windows(model, s, mode, signal, 0), o = predict_one_step(model, s, mode, signal);
    free.t.insert(free.t.end(), s.t_s.begin(), s.t_s.end());
    step.t.insert(step.t.end(), s.t_s.begin(), s.t_s.end());
    free.value.insert(free.value.end(), f.begin(), f.end());
    step.value.insert(step.value.end(), o.begin(), o.end());
    free.value.resize(free.t.size(), NAN);
    step.value.resize(step.t.size(), NAN);
  }
  const std::string name = driveid_signal_name(signal);
  curves.push_back({name + ".free_run", unit_part(name), "prediction", on_rows(raw, free, 1.5 * record.dt_s)});
  curves.push_back({name + ".one_step", unit_part(name), "prediction", on_rows(raw, step, 1.5 * record.dt_s)});
}

void balances(const driveid_model &model, const driveid_record &raw, const EquationSet &set, std::vector<Curve> &curves) {
  for (const Equation &e : set.equation) {
    const Eigen::VectorXd residual = equation_residual(e, model);
    Sampled s;
    double reach = 0;
    for (const Track &t : e.tracks) {
      if (t.part) continue;
      for (std::size_t r = 0; r < t.row.size(); r++) {
        s.t.push_back(t.t0_s + t.row[r] * t.dt_s);
        s.value.push_back(residual[Eigen::Index(t.first + r)]);
      }
      reach = std::max(reach, t.kernel.half * t.dt_s);
    }
    curves.push_back({e.signal + ".equation", e.unit, "residual", on_rows(raw, s, reach)});
  }
}

void series(const char *model_toml, const driveid_record &raw, char **json, double **data) {
  char message[512] = "";
  driveid_model model;
  if (driveid_model_read(model_toml, &model, message, sizeof message)) throw BadData(message);
  const Prepared record = prepare(raw, model);
  if (!record.bad.empty()) throw BadData(record.name + ": " + record.bad);
  std::vector<Curve> curves;
  for (std::size_t c = 0; c < raw.columns; c++) curves.push_back({raw.column[c].name, unit_part(raw.column[c].name), "signal", std::vector<double>(raw.column[c].value, raw.column[c].value + raw.rows)});
  EquationSet set;
  if (model.structure != DRIVEID_STRUCTURE_LTI) set = make_equations(model, {record}, {});
  predictions(model, raw, record, set, curves);
  balances(model, raw, set, curves);
  ordered_json header = {{"format", 1}, {"rows", raw.rows}, {"series", ordered_json::array()}};
  for (const Curve &c : curves) header["series"].push_back({{"name", c.name}, {"unit", c.unit}, {"what", c.what}});
  double *values = new double[std::max<std::size_t>(1, curves.size() * raw.rows)];
  for (std::size_t c = 0; c < curves.size(); c++) std::copy(curves[c].value.begin(), curves[c].value.end(), values + c * raw.rows);
  *data = values;
  *json = text_copy(header.dump());
}

}  // namespace
}  // namespace driveid::diagnose

extern "C" driveid_status driveid_series(const char *model_toml, const driveid_record *record, char **json, double **data, char *message, size_t message_size) {
  if (message && message_size) message[0] = 0;
  if (!model_toml || !record || !json || !data || !record->t_ns || (record->columns && !record->column)) return DRIVEID_ERR_ARGUMENT;
  auto say = [&](driveid_status status, const char *text) {
    if (message && message_size) std::snprintf(message, message_size, "%s", text);
    return status;
  };
  try {
    driveid::diagnose::series(model_toml, *record, json, data);
    return DRIVEID_OK;
  } catch (const driveid::diagnose::BadData &bad) {
    return say(DRIVEID_ERR_DATA, bad.what());
  } catch (const std::bad_alloc &) {
    return say(DRIVEID_ERR_MEMORY, "out of memory");
  } catch (const std::exception &e) {
    return say(DRIVEID_ERR_NUMERIC, e.what());
  }
}

extern "C" void driveid_series_free(double *data) { delete[] data; }
