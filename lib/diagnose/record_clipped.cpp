// SPDX-License-Identifier: Apache-2.0
// A reading cut off at the sensor's limit is wrong; an actuator that stands at its own limit is right. Of the input the balance tells: does the motion
// ask for more than was read, where it stands at the limit? An axis that runs into the end of its range is cut off there, or pushed by the stop.
#include <algorithm>
#include <cmath>
#include <functional>
#include <string>

#include "diagnose/equation.hpp"
#include "diagnose/record_column.hpp"

namespace driveid::diagnose {
namespace {

constexpr double kLeftMin = 0.5;       // of the rows, what must be left
constexpr double kShortfall = 0.03;    // of the limit, below which nothing is gained
constexpr double kSure = 3;            // log-likelihood: a saturated actuator loses no more than some rows by a wrong guess
constexpr std::size_t kPieceMin = 40;

int side_of(const SignalQuality &q, double x) { return q.clipped[1] && x == q.hi ? 1 : q.clipped[0] && x == q.lo ? -1 : 0; }

bool falls_short(const Prepared &record, const driveid_model &model, const Roles &roles) {
  const SignalQuality &q = record.quality.at(roles.input);
  const EquationSet set = make_equations(model, {record}, {});
  for (const Equation &e : set.equation) {
    if (e.electrical || e.drive_unit == 'V') continue;
    Eigen::MatrixXd x(Eigen::Index(e.rows), e.base.cols() + 4);
    x.leftCols(e.base.cols()) = e.base;
    const auto fill = [&](Eigen::Index column, const std::function<double(const Track &, std::size_t)> &value) {
      x.col(e.base.cols() + column) = stack(e, [&](const Track &t, std::vector<double> &f) { f.resize(t.state.size()); for (std::size_t k = 0; k < f.size(); ++k) f[k] = value(t, k); }, 0);
    };
    fill(0, [](const Track &t, std::size_t k) { return t.state[k].direction; });
    fill(1, [](const Track &t, std::size_t k) { return std::fabs(t.state[k].speed) * t.state[k].speed; });
    fill(2, [](const Track &, std::size_t) { return 1.0; });
    fill(3, [&](const Track &t, std::size_t k) { return double(side_of(q, t.drive_raw[k])); });
    const Eigen::VectorXd p = x.colPivHouseholderQr().solve(e.y);
    const double with = (e.y - x * p).squaredNorm(), without = (e.y - x.leftCols(x.cols() - 1) * x.leftCols(x.cols() - 1).colPivHouseholderQr().solve(e.y)).squaredNorm();
    const double independent = double(e.rows) / 3;   // rows overlap
    return -p[p.size() - 1] > kShortfall * e.gain * std::max(std::fabs(q.lo), std::fabs(q.hi)) && 0.5 * independent * std::log(without / std::max(with, 1e-300)) > kSure;
  }
  return false;
}

}  // namespace

void take_out_clipped(Prepared &record, const driveid_model &model) {
  const Roles roles = roles_of(model, record);
  std::vector<std::string> wrong;
  for (const std::string *name : {&roles.position, &roles.input}) {
    if (name->empty()) continue;
    const SignalQuality &q = record.quality.at(*name);
    if ((q.clipped[0] || q.clipped[1]) && (name != &roles.input || falls_short(record, model, roles))) wrong.push_back(*name);
  }
  if (wrong.empty()) return;
  std::vector<Piece> kept;
  std::size_t all = 0, out = 0, left = 0;
  for (const Piece &p : record.pieces) {
    const auto clipped = [&](std::size_t k) {
      return std::any_of(wrong.begin(), wrong.end(), [&](const std::string &n) { return side_of(record.quality.at(n), p.signal.at(n)[k]) != 0; });
    };
    for (std::size_t a = 0, b; a < p.n; a = b + 1) {
      for (b = a; b < p.n && !clipped(b);) ++b;
      out += b < p.n;
      if (b - a >= kPieceMin) kept.push_back(p.part(a, b, record.dt_s)), left += b - a;
    }
    all += p.n;
  }
  const bool enough = double(left) > kLeftMin * double(all);
  if (enough) record.pieces = std::move(kept);
  record.notices.push_back({"clipped", wrong[0] + text(enough ? " is cut off there: %.0f rows are taken out" : " is cut off there in %.0f rows: too little is left without them, and the values are wrong by it; record with a wider range", double(out)), ""});
}

}  // namespace driveid::diagnose
