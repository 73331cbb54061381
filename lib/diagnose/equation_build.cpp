// SPDX-License-Identifier: Apache-2.0
// From prepared records to the equations of a model: kernel width, fine-grid states, rests, rows, blocks, base columns.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "diagnose/equation.hpp"

namespace driveid::diagnose {
namespace {

constexpr std::size_t kRowsMax = 24000;  // rows of one equation
constexpr int kBlocksOfFold = 4;

struct Source {
  const Prepared *record;
  int index;
  bool held_out;
  Roles roles;
};

const driveid_param *parameter(const driveid_model &model, const char *name) {
  for (unsigned k = 0; k < model.params; ++k)
    if (!std::strcmp(model.param[k].name, name)) return &model.param[k];
  return nullptr;
}

double known_value(const driveid_model &model, const char *name) {
  const driveid_param *p = parameter(model, name);
  return p && p->state == DRIVEID_PARAM_GIVEN ? p->value : 0.0;
}

std::vector<double> convolve_all(const std::vector<double> &x, const Kernel &k, int derivative) {
  const std::ptrdiff_t n = std::ptrdiff_t(x.size()), h = k.half;
  std::vector<double> out(x.size(), 0.0);
  const double *w = k.w[derivative].data();
  for (std::ptrdiff_t c = h; c + h < n; ++c) {
    double sum = 0, centre = derivative ? x[std::size_t(c)] : 0;
    for (std::ptrdiff_t i = -h; i <= h; ++i) sum += w[i + h] * (x[std::size_t(c + i)] - centre);
    out[std::size_t(c)] = sum;
  }
  for (std::ptrdiff_t c = 0; c < std::min(h, n); ++c) out[std::size_t(c)] = n > 2 * h ? out[std::size_t(h)] : x[std::size_t(c)];
  for (std::ptrdiff_t c = std::max<std::ptrdiff_t>(0, n - h); c < n; ++c) out[std::size_t(c)] = n > 2 * h ? out[std::size_t(n - h - 1)] : x[std::size_t(c)];
  return out;
}

double norm2(const std::vector<double> &w) {
  double s = 0;
  for (double v : w) s += v * v;
  return std::sqrt(s);
}

// Half width (s) that leaves the acceleration with at most 1 % noise power: at least 12 ms (drives do little above 50 Hz) and 4 samples,
// at most 80 ms or 8 samples.
double choose_width(const Source &s) {
  const Prepared &r = *s.record;
  const bool from_speed = s.roles.position.empty();
  const std::string &name = from_speed ? s.roles.speed : s.roles.position;
  const double sigma = r.quality.at(name).noise;
  const int most = std::max(8, int(0.08 / r.dt_s)), least = std::max(4, int(0.012 / r.dt_s + 0.5));
  static const int widths[] = {4, 5, 6, 8, 10, 12, 15, 18, 22, 27, 33, 40, 50, 60, 75, 90, 110, 135, 165, 200, 250, 320, 400};
  int best = least;
  for (int h : widths) {
    if (h < least && h < most) continue;
    if (h > most) break;
    best = h;
    Kernel k = make_kernel(h, r.dt_s);
    double noise = sigma * norm2(k.w[from_speed ? 1 : 2]), sum = 0;
    std::size_t count = 0;
    for (const Piece &p : r.pieces) {
      const auto &x = p.signal.at(name);
      for (std::size_t c = std::size_t(h); c + std::size_t(h) < p.n; c += std::size_t(std::max(1, h / 2))) {
        double a = 0;
        for (int i = -h; i <= h; ++i) a += k.w[from_speed ? 1 : 2][std::size_t(i + h)] * (x[std::size_t(std::ptrdiff_t(c) + i)] - x[c]);
        sum += a * a;
        ++count;
      }
    }
    double power = count ? sum / double(count) : 0;
    if (noise * noise < 0.01 * std::max(0.0, power - noise * noise)) break;
  }
  return best * r.dt_s;
}

struct Fine {   // smoothed kinematics of a piece
  std::vector<double> position, speed, accel, raw_speed;
  double speed_noise = 0;
};

Fine kinematics(const Source &s, const Piece &p, double dt, const Kernel &wide, const Kernel &narrow) {
  Fine f;
  if (!s.roles.position.empty()) {
    f.position = p.signal.at(s.roles.position);
    f.speed = convolve_all(f.position, narrow, 1);
    f.accel = convolve_all(f.position, wide, 2);
    f.speed_noise = s.record->quality.at(s.roles.position).noise * norm2(narrow.w[1]);
  } else {
    f.raw_speed = p.signal.at(s.roles.speed);
    f.speed = convolve_all(f.raw_speed, narrow, 0);
    f.accel = convolve_all(f.raw_speed, wide, 1);
    f.speed_noise = s.record->quality.at(s.roles.speed).noise * norm2(narrow.w[0]);
    f.position.assign(p.n, 0.0);
    for (std::size_t k = 1; k < p.n; ++k) f.position[k] = f.position[k - 1] + 0.5 * dt * (f.raw_speed[k] + f.raw_speed[k - 1]);
  }
  return f;
}

// Rest: the smoothed speed stays inside its own noise for at least a kernel's width.
std::vector<unsigned char> rests(const Fine &f, const Source &s, double dt, int half) {
  std::vector<unsigned char> rest(f.speed.size(), 0);
  double quantum = s.roles.position.empty() ? 0 : s.record->quality.at(s.roles.position).quantum;
  double limit = std::max(4 * f.speed_noise, 0.7 * quantum / (double(half) * dt));
  std::size_t a = 0;
  const std::size_t n = f.speed.size();
  for (std::size_t k = 0; k <= n; ++k) {
    bool slow = k < n && std::fabs(f.speed[k]) < limit;
    if (slow) continue;
    if (k - a >= std::size_t(std::max(4, half))) std::fill(rest.begin() + std::ptrdiff_t(a), rest.begin() + std::ptrdiff_t(k), 1);
    a = k + 1;
  }
  return rest;
}

void fill_states(Track &t, const Piece &p, const Fine &f, const std::vector<double> &drive, double gain, double shift_s, const std::vector<double> &current,
                 const std::vector<double> *temperature, bool electrical, double resistance) {
  const std::size_t n = p.n;
  t.state.assign(n, driveid_effect_state{});
  const double shift = shift_s / t.dt_s, whole = std::floor(shift), part = shift - whole;
  for (std::size_t k = 0; k < n; ++k) {
    driveid_effect_state &s = t.state[k];
    s.t_s = p.t0_s + double(k) * t.dt_s;
    s.dt_s = k ? t.dt_s : 0;
    if (!f.speed.empty()) {
      s.angle = f.position[k];
      s.speed = f.speed[k];
      s.accel = f.accel[k];
      double a = k ? 0.5 * (f.speed[k] + f.speed[k - 1]) : f.speed[k], b = k + 1 < n ? 0.5 * (f.speed[k] + f.speed[k + 1]) : f.speed[k];
      if ((a > 0) == (b > 0)) s.direction = a > 0 ? 1 : -1;
      else s.direction = (std::fabs(b) * (b > 0 ? 1 : -1) + std::fabs(a) * (a > 0 ? 1 : -1)) / std::max(1e-300, std::fabs(a) + std::fabs(b));
    }
    auto at = [&](double index) { return drive[std::size_t(std::clamp(index, 0.0, double(n - 1)))]; };
    s.drive = (1 - part) * at(double(k) - whole) + part * at(double(k) - whole - 1);
    s.gain = gain;
    s.torque = gain * s.drive;
    s.current_A = current.empty() ? 0 : current[k];
    s.resistance_ohm = resistance;
    s.electrical = electrical;
    if (temperature) s.T_degC = (*temperature)[k], s.has_temperature = 1;
  }
}

// Rows a third of the half width apart, away from the ends, from rests and from long fills.
void place_rows(Track &t, const Piece &p, int step, bool skip_rests, int &run) {
  const int n = int(p.n), half = t.kernel.half, margin = 2 * half + 2;
  std::vector<int> bad(p.n + 1, 0);
  int filled = 0;
  for (int k = 0; k < n; ++k) {
    filled = p.filled[std::size_t(k)] ? filled + 1 : 0;
    bool b = filled >= 3 || (skip_rests && t.rest[std::size_t(k)]);
    bad[std::size_t(k) + 1] = bad[std::size_t(k)] + b;
  }
  ++run;
  bool open = false;
  for (int c = margin; c < n - margin; c += step) {
    if (bad[std::size_t(c + half + 1)] - bad[std::size_t(c - half)] > 0) {
      if (open) ++run;
      open = false;
      continue;
    }
    open = true;
    t.row.push_back(c);
    t.run.push_back(run);
  }
}

void finish(Equation &e) {
  e.rows = 0;
  for (Track &t : e.tracks) t.first = e.rows, e.rows += t.row.size();
  e.y = e.drive = delayed_target(e, 0);
  e.weight.assign(e.rows, 1.0);
}

void add_base(Equation &e, const driveid_model &model, const char *name, const FineSignal &signal, int derivative, double sign = 1) {
  Eigen::VectorXd column = sign * stack(e, signal, derivative);
  double value = known_value(model, name);
  const driveid_param *p = parameter(model, name);
  if (p && p->state == DRIVEID_PARAM_GIVEN) {
    e.y -= value * column;
    e.base_column.push_back({name, true, value});
    return;
  }
  e.base.conservativeResize(Eigen::Index(e.rows), e.base.cols() + 1);
  e.base.col(e.base.cols() - 1) = column;
  e.base_column.push_back({name, false, 0});
}

// Contiguous folds: about six of the training records and six of the held-out ones, or ten with three set aside; four blocks in each.
void make_blocks(Equation &e) {
  int records = 0;
  bool any_held = false;
  for (const Track &t : e.tracks) records = std::max(records, t.record + 1), any_held |= t.held_out;
  std::vector<std::size_t> rows(std::size_t(records), 0);
  std::vector<unsigned char> held(std::size_t(records), 0);
  for (const Track &t : e.tracks) rows[std::size_t(t.record)] += t.row.size(), held[std::size_t(t.record)] = t.held_out;
  int trainings = 0, helds = 0;
  for (int r = 0; r < records; ++r) (held[std::size_t(r)] ? helds : trainings) += rows[std::size_t(r)] > 0;
  e.block.assign(e.rows, 0);
  e.block_held_out.clear();
  e.block_fold.clear();
  int folds = 0;
  std::vector<int> base(std::size_t(records), 0), blocks(std::size_t(records), 1);
  for (int r = 0; r < records; ++r) {
    int many = any_held ? 6 : 10, sharing = held[std::size_t(r)] ? helds : trainings;
    blocks[std::size_t(r)] = std::max(2, (many + sharing - 1) / std::max(1, sharing));
    base[std::size_t(r)] = int(e.block_held_out.size());
    for (int b = 0; b < blocks[std::size_t(r)]; ++b, ++folds)
      for (int part = 0; part < kBlocksOfFold; ++part) {
        e.block_held_out.push_back(any_held ? held[std::size_t(r)] : blocks[std::size_t(r)] == 2 ? b == 1 : b % 3 == 1 && b < 9);
        e.block_fold.push_back(folds);
      }
  }
  std::vector<std::size_t> seen(std::size_t(records), 0);
  for (const Track &t : e.tracks)
    for (std::size_t k = 0; k < t.row.size(); ++k) {
      auto r = std::size_t(t.record);
      const int many = blocks[r] * kBlocksOfFold, b = int(seen[r] * std::size_t(many) / std::max<std::size_t>(1, rows[r]));
      e.block[t.first + k] = base[r] + std::min(b, many - 1);
      ++seen[r];
    }
}

double rms_with(const Equation &e, const Eigen::MatrixXd &x, const Eigen::VectorXd &y) {
  Eigen::VectorXd scale = (x.colwise().norm().array() + 1e-300).matrix();
  Eigen::MatrixXd q = x * scale.cwiseInverse().asDiagonal();
  Eigen::MatrixXd g = q.transpose() * q;
  g.diagonal().array() += 1e-10;
  Eigen::VectorXd p = g.ldlt().solve(q.transpose() * y);
  return std::sqrt((y - q * p).squaredNorm() / double(std::max<std::size_t>(1, e.rows)));
}

// Held (+dt/2), instant (0) or averaged over the sample before (-dt/2): whichever leaves least, beside friction that may be missing.
void detect_hold(Equation &e, double dt, const std::string &told, std::vector<Notice> &notices) {
  if (told == "average") { e.input_shift_s = -0.5 * dt; return; }
  if (told == "zoh") { e.input_shift_s = 0.5 * dt; return; }
  if (told == "instant") { e.input_shift_s = 0; return; }
  Eigen::MatrixXd x(Eigen::Index(e.rows), e.base.cols() + 3);
  x.leftCols(e.base.cols()) = e.base;
  x.col(e.base.cols()) = stack(e, [&](const Track &t, std::vector<double> &f) { f.resize(t.state.size()); for (std::size_t k = 0; k < f.size(); ++k) f[k] = e.electrical ? (t.state[k].current_A > 0 ? 1.0 : -1.0) : t.state[k].direction; }, 0);
  x.col(e.base.cols() + 1).setOnes();
  x.col(e.base.cols() + 2) = stack(e, [](const Track &t, std::vector<double> &f) { f.resize(t.state.size()); for (std::size_t k = 0; k < f.size(); ++k) f[k] = std::fabs(t.state[k].speed) * t.state[k].speed; }, 0);
  Eigen::VectorXd known = delayed_target(e, 0) - e.y;   // given terms, not shifted
  // In a voltage equation half a sample is nearly collinear with R i: the mean over the sample is assumed unless the data object.
  double best = INFINITY, chosen = 0;
  std::vector<double> shifts{-0.5, 0.0, 0.5};
  if (!e.electrical) {   // the skew between current and angle lies anywhere within half a sample, a differenced speed lags by as much again
    shifts.clear();
    for (int k = -5; k <= (e.tracks[0].speed_raw.empty() ? 5 : 10); ++k) shifts.push_back(0.1 * k);
  }
  for (double s : shifts) {
    double r = rms_with(e, x, delayed_target(e, s * dt) - known);
    if (r < (best == INFINITY || !e.electrical ? 1.0 : 0.98) * best) best = r, chosen = s;
  }
  e.input_shift_s = chosen * dt;
  chosen = chosen < -0.25 ? -0.5 : chosen > 0.25 ? 0.5 : 0;
  const char *what = chosen < 0 ? "averaged over the sample before its stamp" : chosen > 0 ? "held from its stamp to the next" : "an instant value at its stamp";
  notices.push_back({"hold", std::string("the input of the ") + e.signal + " equation is read as " + what + " (detected; --hold says otherwise)", ""});
}

void reshift_states(Equation &e) {
  for (Track &t : e.tracks) {
    const std::size_t n = t.state.size();
    const double shift = e.input_shift_s / t.dt_s, whole = std::floor(shift), part = shift - whole;
    for (std::size_t k = 0; k < n; ++k) {
      auto at = [&](double index) { return t.drive_raw[std::size_t(std::clamp(index, 0.0, double(n - 1)))]; };
      t.state[k].drive = (1 - part) * at(double(k) - whole) + part * at(double(k) - whole - 1);
      t.state[k].torque = t.state[k].gain * t.state[k].drive;
    }
  }
}

double floor_low(const Equation &e, const Eigen::VectorXd &parameters, const std::vector<Source> &sources) {
  // noise of position through J w2 + B w1, of the input through w0
  double sum = 0, count = 0;
  for (const Track &t : e.tracks) {
    const Source &s = sources[std::size_t(t.record)];
    double a = parameters.size() > 0 ? parameters[0] : 0, b = parameters.size() > 1 ? parameters[1] : 0, variance = 0;
    const int n = 2 * t.kernel.half + 1;
    if (!e.electrical) {
      bool from_speed = s.roles.position.empty();
      double sigma = s.record->quality.at(from_speed ? s.roles.speed : s.roles.position).noise;
      for (int i = 0; i < n; ++i) {
        double w = from_speed ? a * t.kernel.w[1][std::size_t(i)] + b * t.kernel.w[0][std::size_t(i)] : a * t.kernel.w[2][std::size_t(i)] + b * t.kernel.w[1][std::size_t(i)];
        variance += sigma * sigma * w * w;
      }
      double q = s.record->quality.at(s.roles.input).quantum / std::sqrt(12.0) * e.gain;
      double nw = norm2(t.kernel.w[0]);
      variance += q * q * nw * nw;
    }
    sum += variance * double(t.row.size());
    count += double(t.row.size());
  }
  return count > 0 ? std::sqrt(sum / count) : 0;
}

int row_step(const std::vector<Source> &sources, double width_s) {
  std::size_t total = 0;
  double dt = sources[0].record->dt_s;
  for (const Source &s : sources)
    for (const Piece &p : s.record->pieces) total += p.n;
  int half = std::max(3, int(std::lround(width_s / dt)));
  return std::max({1, half / 3, int((total + kRowsMax - 1) / kRowsMax)});
}

const std::vector<double> *temperature_of(const Piece &p) {
  auto it = p.signal.find("T_degC");
  return it == p.signal.end() ? nullptr : &it->second;
}

// Mechanical balance: J accel + B speed + losses = gain * drive.
Equation mechanical(const driveid_model &model, const std::vector<Source> &sources, double gain, std::vector<Notice> &notices) {
  Equation e;
  const Roles &roles = sources[0].roles;
  bool linear = model.structure == DRIVEID_STRUCTURE_LINEAR_AXIS;
  e.signal = roles.effort_unit == "V" ? "voltage" : linear ? "force" : "torque";
  e.gain = gain;
  e.unit = gain != 1 && roles.per_ampere ? (linear ? "N" : "N m") : roles.effort_unit;
  e.frame = roles.effort_unit == "V" ? DRIVEID_FRAME_VOLT
            : e.unit == "A"          ? (linear ? DRIVEID_FRAME_AMPERE_LINEAR : DRIVEID_FRAME_AMPERE)
            : linear                 ? DRIVEID_FRAME_FORCE : DRIVEID_FRAME_TORQUE;
  e.drive_unit = roles.input == "v_V" ? 'V' : roles.input == "tau_Nm" || roles.input == "F_N" ? 'N' : 'A';
  if (!roles.position.empty()) {
    const SignalQuality &q = sources[0].record->quality.at(roles.position);
    e.quantum = std::max(q.quantum, 6 * q.noise);
  }
  e.input_noise = sources[0].record->quality.at(roles.input).noise;
  double width = choose_width(sources[0]);
  int step = row_step(sources, width), run = 0;
  for (int pass = 0; pass < 2; ++pass) {   // the second pass keeps rests where nearly nothing else is there
    e.tracks.clear();
    std::size_t possible = 0, kept = 0;
    for (const Source &s : sources) {
      double dt = s.record->dt_s;
      int half = std::max(3, int(std::lround(width / dt)));
      Kernel wide = make_kernel(half, dt), narrow = make_kernel(std::max(3, (2 * half) / 3), dt);
      for (const Piece &p : s.record->pieces) {
        if (int(p.n) < 6 * half + 10) continue;
        Track t;
        t.record = s.index;
        t.held_out = s.held_out;
        t.t0_s = p.t0_s;
        t.dt_s = dt;
        t.kernel = wide;
        Fine f = kinematics(s, p, dt, wide, narrow);
        t.position = f.position;
        t.speed_raw = f.raw_speed;
        t.drive_raw = p.signal.at(s.roles.input);
        t.rest = rests(f, s, dt, half);
        t.position_smooth = convolve_all(t.position, wide, 0);
        bool is_current = s.roles.input != "v_V" && s.roles.input != "tau_Nm" && s.roles.input != "F_N";
        fill_states(t, p, f, t.drive_raw, gain, 0, is_current ? t.drive_raw : std::vector<double>(), temperature_of(p), false, 0);
        place_rows(t, p, step, pass == 0, run);
        possible += p.n / std::size_t(step);
        kept += t.row.size();
        e.tracks.push_back(std::move(t));
      }
    }
    if (kept * 6 > possible && kept > 150) break;
  }
  finish(e);
  if (e.rows < 60) return e;
  bool from_speed = roles.position.empty();
  FineSignal motion = [from_speed](const Track &t, std::vector<double> &f) { f = from_speed ? t.speed_raw : t.position; };
  const char *inertia = "J_kgm2", *damping = "B_Nms_rad";
  if (model.structure == DRIVEID_STRUCTURE_TWO_MASS_AXIS) inertia = parameter(model, "J_m_kgm2") ? "J_m_kgm2" : "J_m_As2_rad";
  else if (linear) inertia = e.unit == "A" ? "m_As2_m" : "m_kg", damping = e.unit == "A" ? "b_As_m" : "b_Ns_m";
  else if (e.unit == "A") inertia = "J_As2_rad", damping = "B_As_rad";
  else if (e.unit == "V") inertia = "J_Vs2_rad", damping = "B_Vs_rad";
  add_base(e, model, inertia, motion, from_speed ? 1 : 2);
  add_base(e, model, damping, motion, from_speed ? 0 : 1);
  Eigen::VectorXd before = delayed_target(e, 0);
  detect_hold(e, sources[0].record->dt_s, sources[0].record->hold, notices);
  e.drive = delayed_target(e, 0);
  e.y += e.drive - before;
  reshift_states(e);
  make_blocks(e);
  return e;
}

void note_current(Equation &e) {
  e.current = stack(e, [](const Track &t, std::vector<double> &f) { f = t.current_raw; }, 0);
  e.current_smooth = stack(e, [](const Track &t, std::vector<double> &f) {
    f.resize(t.state.size());
    for (std::size_t k = 0; k < f.size(); ++k) f[k] = t.state[k].current_A;
  }, 0);
}

// Voltage balance of a DC winding: L di/dt + R i + K_e omega + losses = v.
Equation dc_voltage(const driveid_model &model, const std::vector<Source> &sources, std::vector<Notice> &notices) {
  Equation e;
  e.signal = "voltage";
  e.unit = "V";
  e.electrical = true;
  e.drive_unit = 'V';
  const double dt0 = sources[0].record->dt_s, width = std::max(5 * dt0, 0.012);
  int step = row_step(sources, width), run = 0;
  for (const Source &s : sources) {
    double dt = s.record->dt_s;
    int half = std::max(4, int(std::lround(width / dt)));
    Kernel k = make_kernel(half, dt);
    double speed_width = s.roles.position.empty() && s.roles.speed.empty() ? width : choose_width(s);
    Kernel motion_kernel = make_kernel(std::max(3, int(std::lround(speed_width / dt))), dt);
    for (const Piece &p : s.record->pieces) {
      if (int(p.n) < 6 * half + 10) continue;
      Track t;
      t.record = s.index;
      t.held_out = s.held_out;
      t.t0_s = p.t0_s;
      t.dt_s = dt;
      t.kernel = k;
      Fine f;
      if (!s.roles.position.empty() || !s.roles.speed.empty()) f = kinematics(s, p, dt, motion_kernel, motion_kernel);
      t.position = f.position;
      t.speed_raw = f.raw_speed;
      t.drive_raw = p.signal.at("v_V");
      t.rest.assign(p.n, 0);
      t.current_raw = p.signal.at("i_A");
      fill_states(t, p, f, t.drive_raw, 1, 0, convolve_all(t.current_raw, make_kernel(std::max(2, half / 2), dt), 0), temperature_of(p), true, 1);
      place_rows(t, p, step, false, run);
      e.tracks.push_back(std::move(t));
    }
  }
  finish(e);
  if (e.rows < 60) return e;
  FineSignal current = [](const Track &t, std::vector<double> &f) { f = t.current_raw; };
  note_current(e);
  add_base(e, model, "R_ohm", current, 0);
  add_base(e, model, "L_H", current, 1);
  if (!e.tracks[0].position.empty()) {
    bool from_speed = !e.tracks[0].speed_raw.empty();
    add_base(e, model, "K_e_Vs_rad", [from_speed](const Track &t, std::vector<double> &f) { f = from_speed ? t.speed_raw : t.position; }, from_speed ? 0 : 1);
  }
  Eigen::VectorXd before = delayed_target(e, 0);
  detect_hold(e, dt0, sources[0].record->hold, notices);
  e.drive = delayed_target(e, 0);
  e.y += e.drive - before;
  reshift_states(e);
  make_blocks(e);
  return e;
}

// dq voltages stacked: rows of d, then rows of q, one set of columns.
Equation dq_voltage(const driveid_model &model, const std::vector<Source> &sources, std::vector<Notice> &notices) {
  Equation e;
  e.signal = "voltage";
  e.unit = "V";
  e.electrical = true;
  e.drive_unit = 'V';
  const driveid_param *pp = parameter(model, "pole_pairs");
  const double pairs = pp && pp->state != DRIVEID_PARAM_UNSET ? pp->value : 1;
  const double dt0 = sources[0].record->dt_s, width = std::max(5 * dt0, 0.012);
  int step = 2 * row_step(sources, width), run = 0;
  std::vector<std::vector<double>> id, iq, we;   // by track
  for (int part = 0; part < 2; ++part)
    for (const Source &s : sources) {
      double dt = s.record->dt_s;
      int half = std::max(4, int(std::lround(width / dt)));
      Kernel k = make_kernel(half, dt), motion_kernel = make_kernel(std::max(3, int(std::lround(choose_width(s) / dt))), dt);
      for (const Piece &p : s.record->pieces) {
        if (int(p.n) < 6 * half + 10) continue;
        Track t;
        t.record = s.index;
        t.held_out = s.held_out;
        t.part = part;
        t.t0_s = p.t0_s;
        t.dt_s = dt;
        t.kernel = k;
        Fine f = kinematics(s, p, dt, motion_kernel, motion_kernel);
        t.position = f.position;
        t.speed_raw = f.raw_speed;
        t.drive_raw = p.signal.at(part ? "v_q_V" : "v_d_V");
        t.rest.assign(p.n, 0);
        t.current_raw = p.signal.at(part ? "i_q_A" : "i_d_A");
        fill_states(t, p, f, t.drive_raw, 1, 0, convolve_all(t.current_raw, make_kernel(std::max(2, half / 2), dt), 0), temperature_of(p), true, 1);
        place_rows(t, p, step, false, run);
        id.push_back(p.signal.at("i_d_A"));
        iq.push_back(p.signal.at("i_q_A"));
        we.push_back(f.speed);
        for (double &w : we.back()) w *= pairs;
        e.tracks.push_back(std::move(t));
      }
    }
  finish(e);
  if (e.rows < 60) return e;
  auto index = [&](const Track &t) { return std::size_t(&t - e.tracks.data()); };
  note_current(e);
  FineSignal resistance = [&](const Track &t, std::vector<double> &f) { f = t.part ? iq[index(t)] : id[index(t)]; };
  add_base(e, model, "R_ohm", resistance, 0);
  // L_d: d rows L_d did/dt, q rows + w L_d i_d; L_q: d rows - w L_q i_q, q rows L_q diq/dt
  auto product = [](const std::vector<double> &a, const std::vector<double> &b, double sign) { std::vector<double> c(a.size()); for (std::size_t k = 0; k < c.size(); ++k) c[k] = sign * a[k] * b[k]; return c; };
  auto mixed = [&](bool of_d) {
    Eigen::VectorXd out{Eigen::Index(e.rows)};
    for (const Track &t : e.tracks) {
      std::size_t j = index(t);
      bool derivative = (t.part == 0) == of_d;
      std::vector<double> fine = derivative ? (of_d ? id[j] : iq[j]) : product(we[j], of_d ? id[j] : iq[j], of_d ? 1 : -1);
      apply_kernel(t, fine, derivative ? 1 : 0, out.data() + t.first);
    }
    return out;
  };
  auto add = [&](const char *name, const Eigen::VectorXd &column) {
    const driveid_param *p = parameter(model, name);
    if (p && p->state == DRIVEID_PARAM_GIVEN) {
      e.y -= p->value * column;
      e.base_column.push_back({name, true, p->value});
      return;
    }
    e.base.conservativeResize(Eigen::Index(e.rows), e.base.cols() + 1);
    e.base.col(e.base.cols() - 1) = column;
    e.base_column.push_back({name, false, 0});
  };
  add("L_d_H", mixed(true));
  add("L_q_H", mixed(false));
  FineSignal emf = [&](const Track &t, std::vector<double> &f) { f = we[index(t)]; if (!t.part) std::fill(f.begin(), f.end(), 0.0); };
  add_base(e, model, "psi_pm_Vs", emf, 0);
  Eigen::VectorXd before = delayed_target(e, 0);
  detect_hold(e, dt0, sources[0].record->hold, notices);
  e.drive = delayed_target(e, 0);
  e.y += e.drive - before;
  reshift_states(e);
  make_blocks(e);
  return e;
}

double solve_for(const Equation &e, const char *name) {
  if (e.rows < 60 || e.base.cols() == 0) return 0;
  for (const BaseColumn &b : e.base_column)
    if (b.given && b.name == name) return b.value;
  Eigen::MatrixXd x(e.base.rows(), e.base.cols() + 1);
  x.leftCols(e.base.cols()) = e.base;
  x.col(e.base.cols()) = stack(e, [](const Track &t, std::vector<double> &f) { f.resize(t.state.size()); for (std::size_t k = 0; k < f.size(); ++k) f[k] = t.state[k].current_A > 0 ? 1 : -1; }, 0);
  Eigen::VectorXd p = x.colPivHouseholderQr().solve(e.y);
  int c = 0;
  for (const BaseColumn &b : e.base_column) {
    if (b.given) continue;
    if (b.name == name) return p[c];
    ++c;
  }
  return 0;
}

}  // namespace

EquationSet make_equations(const driveid_model &model, const std::vector<Prepared> &training, const std::vector<Prepared> &held_out) {
  EquationSet set;
  std::vector<Source> sources;
  for (const Prepared &p : training) sources.push_back({&p, int(sources.size()), false, roles_of(model, p)});
  for (const Prepared &p : held_out) sources.push_back({&p, int(sources.size()), true, roles_of(model, p)});
  for (const Source &s : sources)
    if (!s.record->bad.empty()) {
      set.bad = s.record->name + ": " + s.record->bad;
      return set;
    }
  auto all_have = [&](std::initializer_list<const char *> names) {
    for (const Source &s : sources)
      for (const char *n : names)
        if (!s.record->has(n)) return false;
    return true;
  };
  auto motion = [&] {
    for (const Source &s : sources)
      if (s.roles.position.empty() && s.roles.speed.empty()) return false;
    return true;
  };
  double gain = sources[0].roles.input_gain;
  const auto structure = model.structure;
  const bool circuit = structure == DRIVEID_STRUCTURE_DC_CIRCUIT, drive = structure == DRIVEID_STRUCTURE_DC_DRIVE, pmsm = structure == DRIVEID_STRUCTURE_PMSM_DRIVE;
  if ((circuit || drive) && all_have({"v_V", "i_A"})) {
    Equation e = dc_voltage(model, sources, set.notices);
    if (drive && sources[0].roles.per_ampere && e.rows >= 60) gain = std::max(1e-9, solve_for(e, "K_e_Vs_rad"));
    if (e.rows >= 60) set.equation.push_back(std::move(e));
  } else if (circuit) {
    set.bad = "dc_circuit needs the columns v_V and i_A (and speed or angle for K_e): record voltage and current";
    return set;
  }
  if (pmsm && all_have({"v_d_V", "v_q_V", "i_d_A", "i_q_A"}) && motion()) {
    Equation e = dq_voltage(model, sources, set.notices);
    const driveid_param *pp = parameter(model, "pole_pairs");
    if (sources[0].roles.per_ampere && e.rows >= 60 && pp && pp->state != DRIVEID_PARAM_UNSET) gain = std::max(1e-9, 1.5 * pp->value * solve_for(e, "psi_pm_Vs"));
    if (e.rows >= 60) set.equation.push_back(std::move(e));
  }
  if (!circuit && structure != DRIVEID_STRUCTURE_LTI) {
    bool ready = motion();
    for (const Source &s : sources) ready &= !s.roles.input.empty();
    if (ready) {
      const SignalQuality &in = sources[0].record->quality.at(sources[0].roles.input);
      const std::string moving = sources[0].roles.position.empty() ? sources[0].roles.speed : sources[0].roles.position;
      if (in.constant) set.bad = sources[0].roles.input + " never changes: record a motion with accelerations in both directions";
      else if (sources[0].record->quality.at(moving).constant) set.bad = moving + " never changes: the axis does not move in this record; record a motion";
      else {
        Equation e = mechanical(model, sources, gain, set.notices);
        if (e.rows >= 60) set.equation.push_back(std::move(e));
        else if (set.equation.empty()) set.bad = "too little motion for an equation: record at least some seconds with accelerations in both directions";
      }
    } else if (set.equation.empty()) {
      bool linear = structure == DRIVEID_STRUCTURE_LINEAR_AXIS;
      set.bad = motion() ? (linear ? "no input column: record F_N, or i_A with K_F_N_A given" : "no input column: record i_A, i_q_A or tau_Nm")
                         : (linear ? "no motion column: record x_m or v_m_s" : "no motion column: record theta_rad or omega_rad_s");
    }
  }
  if (structure == DRIVEID_STRUCTURE_LTI && set.equation.empty() && set.bad.empty()) {
    if (!all_have({"u", "y"})) set.bad = "lti needs the columns u and y";
    else set.bad = "explain works on drive structures; use fit and compare for lti";
  }
  if (!set.bad.empty()) set.equation.clear();
  for (Equation &e : set.equation) {
    Eigen::VectorXd p = e.base.cols() ? Eigen::VectorXd(e.base.colPivHouseholderQr().solve(e.y)) : Eigen::VectorXd();
    e.floor_lo = floor_low(e, p, sources);
  }
  return set;
}

}  // namespace driveid::diagnose
