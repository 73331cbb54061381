// SPDX-License-Identifier: Apache-2.0
// Start values: the model's own effects as members of the equation's search, shapes refined together, everything linear solved at once.
#include <cmath>
#include <cstring>

#include "diagnose/explain_search.hpp"
#include "diagnose/fit_core.hpp"

namespace driveid::diagnose {
namespace {

struct Placed {               // an effect of the model that stands in this equation
  int effect = -1;            // -1: the second mass of a two_mass_axis
  Member member;
};

driveid_param *structure_param(driveid_model &model, const std::string &name) {
  for (uint32_t k = 0; k < model.params; k++)
    if (name == model.param[k].name) return &model.param[k];
  return nullptr;
}

bool has_values(const driveid_effect_use &use) {
  for (uint32_t k = 0; k < use.params; k++)
    if (use.param[k].state == DRIVEID_PARAM_UNSET) return false;
  return use.params > 0;
}

std::vector<double> values_of(const driveid_effect_use &use) {
  std::vector<double> v;
  for (uint32_t k = 0; k < use.params; k++) v.push_back(use.param[k].value);
  return v;
}

std::vector<double> formula_shape(const driveid_effect_use &use) {
  driveid_formula f;
  std::vector<double> shape;
  if (driveid_formula_parse(use.formula, &f, nullptr, 0)) return shape;
  for (uint32_t k = 0; k < f.params; k++)
    if (!(f.linear_mask >> k & 1u)) shape.push_back(use.param[k].value);
  return shape;
}

// Candidates of the model's effects in this equation; index by effect, -1 where the effect does not stand here.
std::vector<Candidate> own_candidates(const Equation &e, const driveid_model &model, std::vector<int> &of_effect, int &second_mass, std::vector<Notice> &notices) {
  const std::vector<Candidate> all = make_candidates(e);
  std::vector<Candidate> out;
  auto take = [&](const char *name) {
    for (const Candidate &c : all)
      if (c.name == name) {
        out.push_back(c);
        return int(out.size()) - 1;
      }
    return -1;
  };
  for (uint32_t k = 0; k < model.effects; k++) {
    const driveid_effect_use &use = model.effect[k];
    if (use.formula[0]) {
      std::string error;
      const bool here = (std::strcmp(use.adds_to, "v_V") == 0) == (e.electrical || e.drive_unit == 'V');
      if (!here) { of_effect.push_back(-1); continue; }
      out.push_back(own_candidate(use, error));
      of_effect.push_back(int(out.size()) - 1);
      if (!error.empty()) notices.push_back({"formula", error, ""});
    } else {
      of_effect.push_back(take(use.name));
    }
  }
  second_mass = model.structure == DRIVEID_STRUCTURE_TWO_MASS_AXIS && !e.electrical ? take("compliance") : -1;
  return out;
}

std::vector<double> start_shape(const Equation &e, const driveid_effect_use &use, const Candidate &c) {
  if (!has_values(use)) return {};
  return use.formula[0] ? formula_shape(use) : shape_of(e, c, values_of(use));
}

void place(Search &search, const Equation &e, const driveid_model &model, const std::vector<int> &of_effect, int second_mass, std::vector<Placed> &placed) {
  std::vector<Member> members;
  auto add = [&](int effect, int candidate, std::vector<double> shape) {
    const Candidate &c = search.candidates()[std::size_t(candidate)];
    if (shape.empty() && !c.axis.empty()) {
      std::vector<int> skip;
      for (std::size_t k = 0; k < search.candidates().size(); k++)
        if (int(k) != candidate) skip.push_back(int(k));
      const std::vector<Option> offered = search.offer(members, skip);
      shape = offered[std::size_t(candidate)].shape;
      if (shape.size() != c.axis.size()) {
        shape.clear();
        for (const ShapeAxis &a : c.axis) shape.push_back(a.grid.empty() ? a.lo : a.grid[a.grid.size() / 2]);
      }
    }
    Member m;
    m.candidate = candidate;
    m.shape = shape;
    members.push_back(m);
    placed.push_back({effect, m});
  };
  if (second_mass >= 0) add(-1, second_mass, {});
  for (uint32_t k = 0; k < model.effects; k++)
    if (of_effect[k] >= 0) add(int(k), of_effect[k], start_shape(e, model.effect[k], search.candidates()[std::size_t(of_effect[k])]));
}

void set(driveid_param &param, double value, double sd) {
  if (param.state == DRIVEID_PARAM_GIVEN || !std::isfinite(value)) return;
  param.state = DRIVEID_PARAM_FREE;
  param.value = value;
  const double half = std::isfinite(sd) ? 1.96 * sd : 0.0;
  param.lo = value - half;
  param.hi = value + half;
}

// Published values of one member, and their spread by differences over (linear, shape).
void publish_member(const Equation &e, const Candidate &c, const Member &member, const Eigen::VectorXd &linear, const Eigen::MatrixXd &cov, driveid_effect_use &use) {
  auto published = [&](const std::vector<double> &shape, const Eigen::VectorXd &lin) {
    if (c.info) return publish(e, c, shape, lin);
    std::vector<double> p;                       // own formula: linear and shape parameters in the order of their names
    driveid_formula f;
    if (driveid_formula_parse(c.formula.c_str(), &f, nullptr, 0)) return p;
    Eigen::Index l = 0;
    std::size_t s = 0;
    for (uint32_t k = 0; k < f.params; k++) p.push_back(f.linear_mask >> k & 1u ? lin[l++] : shape[s++]);
    return p;
  };
  const std::vector<double> value = published(member.shape, linear);
  const Eigen::Index n = linear.size() + Eigen::Index(member.shape.size());
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(Eigen::Index(value.size()), n);
  for (Eigen::Index k = 0; k < n && k < cov.rows(); k++) {
    const double step = 1e-3 * std::sqrt(std::max(cov(k, k), 0.0));
    if (!(step > 0) || !std::isfinite(step)) continue;
    Eigen::VectorXd lin = linear;
    std::vector<double> shape = member.shape;
    if (k < linear.size()) lin[k] += step;
    else shape[std::size_t(k - linear.size())] += step;
    const std::vector<double> moved = published(shape, lin);
    for (std::size_t p = 0; p < value.size(); p++) jacobian(Eigen::Index(p), k) = (moved[p] - value[p]) / step;
  }
  const Eigen::MatrixXd spread = jacobian * cov.topLeftCorner(n, n) * jacobian.transpose();
  for (uint32_t p = 0; p < use.params && p < value.size(); p++) set(use.param[p], value[p], std::sqrt(std::max(0.0, spread(p, p))));
}

}  // namespace

bool fit_equation(const Equation &equation, driveid_model &model, int threads, std::vector<Notice> &notices) {
  std::vector<int> of_effect;
  int second_mass = -1;
  std::vector<Candidate> candidates = own_candidates(equation, model, of_effect, second_mass, notices);
  Search search(equation, candidates, threads);
  std::vector<Placed> placed;
  place(search, equation, model, of_effect, second_mass, placed);
  std::vector<Member> members;
  for (const Placed &p : placed) members.push_back(p.member);
  if (members.size() == 1 && !search.candidates()[std::size_t(members[0].candidate)].axis.empty()) {
    const Option o = search.refine(members[0].candidate, {}, members[0].shape);
    if (o.shape.size() == members[0].shape.size()) members[0].shape = o.shape;
  }
  for (int round = 0; round < 2; round++) search.polish(members);
  const Solution solution = search.solve(members);
  const Eigen::MatrixXd cov = search.covariance(solution);
  if (!solution.coefficient.allFinite()) return false;
  Eigen::Index at = 0;
  for (const BaseColumn &b : equation.base_column) {
    if (b.given) continue;
    if (driveid_param *p = structure_param(model, b.name)) set(*p, solution.coefficient[at], std::sqrt(std::max(0.0, cov(at, at))));
    at++;
  }
  Eigen::Index shape_at = solution.coefficient.size();
  for (std::size_t m = 0; m < members.size(); m++) {
    const Candidate &c = search.candidates()[std::size_t(members[m].candidate)];
    const Eigen::Index nl = solution.linear[m].size(), ns = Eigen::Index(members[m].shape.size());
    Eigen::MatrixXd part = Eigen::MatrixXd::Zero(nl + ns, nl + ns);
    for (Eigen::Index i = 0; i < nl + ns; i++)
      for (Eigen::Index j = 0; j < nl + ns; j++) {
        const Eigen::Index a = i < nl ? at + i : shape_at + i - nl, b = j < nl ? at + j : shape_at + j - nl;
        if (a < cov.rows() && b < cov.cols()) part(i, j) = cov(a, b);
      }
    if (placed[m].effect >= 0) {
      publish_member(equation, c, members[m], solution.linear[m], part, model.effect[placed[m].effect]);
    } else {                                    // two masses: J_l, k, d, and what is left for the motor
      driveid_effect_use use = {};
      use.params = 3;
      publish_member(equation, c, members[m], solution.linear[m], part, use);
      const bool per_ampere = structure_param(model, "J_l_As2_rad") != nullptr;
      const char *names[3] = {per_ampere ? "J_l_As2_rad" : "J_l_kgm2", per_ampere ? "k_A_rad" : "k_Nm_rad", per_ampere ? "d_As_rad" : "d_Nms_rad"};
      for (int k = 0; k < 3; k++)
        if (driveid_param *p = structure_param(model, names[k])) set(*p, use.param[k].value, (use.param[k].hi - use.param[k].value) / 1.96);
      if (driveid_param *motor = structure_param(model, per_ampere ? "J_m_As2_rad" : "J_m_kgm2")) set(*motor, motor->value - use.param[0].value, (motor->hi - motor->value) / 1.96);
    }
    at += nl;
    shape_at += ns;
  }
  return true;
}

}  // namespace driveid::diagnose
