// SPDX-License-Identifier: Apache-2.0
// What a candidate does to the equation at given shapes.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "diagnose/explain_candidate.hpp"

namespace driveid::diagnose {
namespace {

bool made_of_drive(const Candidate &c) { return is(c, "torque_saturation") || is(c, "torque_ripple") || is(c, "load_dependent_friction"); }

// What a threshold swallows of the drive, by a drive whose noise is averaged below a third of the threshold: the noise of the reading
// never went through it.
Eigen::VectorXd swallowed(const Equation &e, double threshold) {
  return stack(e, [&](const Track &t, std::vector<double> &x) {
    const std::ptrdiff_t n = std::ptrdiff_t(t.state.size()), side = (averaged_samples(e, threshold) - 1) / 2;
    std::vector<double> sum(std::size_t(n) + 1, 0.0);
    for (std::ptrdiff_t k = 0; k < n; ++k) sum[std::size_t(k) + 1] = sum[std::size_t(k)] + t.state[std::size_t(k)].drive;
    x.resize(std::size_t(n));
    for (std::ptrdiff_t k = 0; k < n; ++k) {
      const std::ptrdiff_t a = std::max<std::ptrdiff_t>(0, k - side), b = std::min(n, k + side + 1);
      x[std::size_t(k)] = t.state[std::size_t(k)].gain * std::clamp((sum[std::size_t(b)] - sum[std::size_t(a)]) / double(b - a), -threshold, threshold);
    }
  }, 0);
}

}  // namespace

int averaged_samples(const Equation &e, double threshold) {
  const double ratio = 3 * e.input_noise / std::max(threshold, 1e-300);
  const int most = e.tracks.empty() ? 1 : 2 * e.tracks[0].kernel.half + 1;
  return ratio * ratio >= most ? most : 2 * int(0.5 * ratio * ratio) + 1;
}

// Load position behind spring, damper and (with gap > 0) clearance, driven by the measured motor position. Written without
// the motor's speed: with q = x' - 2 zeta w theta the drive enters undifferentiated.
void load_position(const Track &t, double w, double zeta, double gap, std::vector<double> &x) {
  const std::vector<double> &position = !(gap > 0) || t.position_smooth.empty() ? t.position : t.position_smooth;
  const std::size_t n = position.size();
  x.resize(n);
  if (n == 0) return;
  const int sub = std::max(1, int(std::ceil(w * t.dt_s / 0.25)));
  const double h = t.dt_s / sub;
  double p = position[0], v = n > 1 ? (position[std::min<std::size_t>(n - 1, 8)] - position[0]) / (t.dt_s * double(std::min<std::size_t>(n - 1, 8))) : 0;
  const double half = 0.5 * gap;
  for (std::size_t k = 0; k < n; ++k) {
    x[k] = p;
    if (k + 1 == n) break;
    const double a = position[k], b = position[k + 1], rate = t.state.empty() ? (b - a) / t.dt_s : 0.5 * (t.state[k].speed + t.state[k + 1].speed);
    for (int j = 0; j < sub; ++j) {
      const double m = a + (b - a) * (j + 0.5) / sub;
      const double q = p + 0.5 * h * v, twist = m - q;
      double deflection = twist > half ? twist - half : twist < -half ? twist + half : 0, force = 0;
      if (half <= 0 || deflection != 0) {
        // semi-implicit in the damping so that stiff contacts stay stable
        force = (w * w * deflection + 2 * zeta * w * (rate - v)) / (1 + zeta * w * h + 0.25 * w * w * h * h);
        if (half > 0 && force * deflection < 0) force = 0;   // contact pushes, it does not pull
      }
      p += h * v + 0.5 * h * h * force;
      v += h * force;
    }
  }
}

// Coefficients of columns from which the drive was taken, back to coefficients of the columns themselves: the solution is
// drive (1 + sum c part) - sum c column = inertia ..., so everything is divided by the factor of the drive.
double drive_factor(const Term &term, const Eigen::VectorXd &linear) {
  double factor = term.drive_scale == 1 ? 1.0 : 1.0 / term.drive_scale;
  for (Eigen::Index k = 0; k < term.drive_part.size() && k < linear.size(); ++k) factor += linear[k] * term.drive_part[k];
  return factor;
}

Term realise(const Equation &e, const Candidate &c, const std::vector<double> &shape, const Nominal &nominal) {
  Term term;
  const Eigen::Index rows = Eigen::Index(e.rows);
  if (is(c, "delay")) {
    term.column.resize(rows, 0);
    term.taken = delayed_target(e, 0) - delayed_target(e, shape[0]);
    return term;
  }
  if (is(c, "encoder_eccentricity")) {
    term.column.resize(rows, 2);
    for (int q = 0; q < 2; ++q) {
      FineSignal f = [q](const Track &t, std::vector<double> &x) {
        x.resize(t.position.size());
        for (std::size_t k = 0; k < x.size(); ++k) x[k] = q ? std::cos(t.position[k]) : std::sin(t.position[k]);
      };
      term.column.col(q) = -(nominal.inertia * stack(e, f, 2) + nominal.damping * stack(e, f, 1));
    }
    return term;
  }
  if (is(c, "compliance") || is(c, "backlash")) {
    const bool gap = is(c, "backlash");
    const double w = shape[gap ? 1 : 0], zeta = shape[gap ? 2 : 1], width = gap ? shape[0] : 0;
    term.column.resize(rows, 1);
    term.column.col(0) = stack(e, [&](const Track &t, std::vector<double> &x) {
      load_position(t, w, zeta, width, x);
      const std::vector<double> &motor = !gap || t.position_smooth.empty() ? t.position : t.position_smooth;
      for (std::size_t k = 0; k < x.size(); ++k) x[k] -= motor[k];
    }, 2);
    return term;
  }
  if (is(c, "inertia_change")) {
    // acceleration rows themselves (smoothed once, as the nominal inertia's), switched at the instant
    bool from_speed = !e.tracks[0].speed_raw.empty();
    term.column.resize(rows, 1);
    term.column.col(0) = stack(e, [from_speed](const Track &t, std::vector<double> &x) { x = from_speed ? t.speed_raw : t.position; }, from_speed ? 1 : 2);
    for (const Track &t : e.tracks)
      for (std::size_t r = 0; r < t.row.size(); ++r) {
        double late = (t.state[std::size_t(t.row[r])].t_s - shape[0]) / (t.kernel.half * t.dt_s);
        term.column(Eigen::Index(t.first + r), 0) *= std::clamp(0.5 + late, 0.0, 1.0);
      }
    return term;
  }
  if (!c.info) {   // own effect
    driveid_formula f;
    char message[128];
    if (driveid_formula_parse(c.formula.c_str(), &f, message, sizeof message) < 0) {
      term.column = Eigen::MatrixXd::Zero(rows, c.columns);
      return term;
    }
    std::vector<double> param(DRIVEID_FORMULA_PARAMS_MAX, 1.0);
    std::size_t at = 0;
    for (std::uint32_t k = 0; k < f.params; ++k)
      if (!(f.linear_mask >> k & 1)) param[k] = shape[at++];
    term.column.resize(rows, c.columns);
    int q = 0;
    for (std::uint32_t k = 0; k < f.params; ++k) {
      if (!(f.linear_mask >> k & 1)) continue;
      term.column.col(q++) = stack(e, [&](const Track &t, std::vector<double> &x) {
        double column[DRIVEID_FORMULA_PARAMS_MAX];
        x.resize(t.state.size());
        for (std::size_t j = 0; j < x.size(); ++j) driveid_formula_columns(&f, &t.state[j], param.data(), column), x[j] = column[k];
      }, 0);
    }
    if (c.columns == 0 || f.linear_mask == 0)
      term.taken = stack(e, [&](const Track &t, std::vector<double> &x) {
        x.resize(t.state.size());
        for (std::size_t j = 0; j < x.size(); ++j) x[j] = driveid_formula_value(&f, &t.state[j], param.data(), nullptr);
      }, 0);
    return term;
  }
  Eigen::MatrixXd m = is(c, "dead_zone") ? Eigen::MatrixXd(swallowed(e, shape[0])) : effect_columns(e, *c.info, shape.data());
  if (c.info->fixed & 1) {
    // The scale of the drive is free beside inertia and damping: what remains of it is brought back to its old size,
    // lest a threshold that swallows the whole drive count as a perfect explanation.
    Eigen::VectorXd rest = e.drive - m.col(0);
    double scale = rest.dot(e.drive) / std::max(1e-300, e.drive.squaredNorm());
    term.drive_scale = std::max(scale, 1e-3);
    term.taken = e.drive - rest / term.drive_scale;
    term.column.resize(rows, 0);
  } else if (made_of_drive(c) && !e.electrical) {
    term.drive_part.resize(m.cols());
    for (Eigen::Index k = 0; k < m.cols(); ++k) term.drive_part[k] = remove_drive(e, m.col(k));
    term.column = std::move(m);
  } else {
    term.column = std::move(m);
  }
  return term;
}

}  // namespace driveid::diagnose
