// SPDX-License-Identifier: Apache-2.0
// Every loss on a rigid axis against the independent small-step run. The bound is the discretisation error of both at 1 ms
// (midpoint rule over a sample in ours, 2.5 us Euler in the truth): 0.3 % of the travel over 2 s in free run.
#include "sim_helper.hpp"

using namespace helper;

namespace {
constexpr double J = 1e-4, B = 2e-5, SIZE = 0.05;
double sgn(double x) { return (x > 0) - (x < 0); }
}  // namespace

TEST(SimulateEffects, rigid) { EXPECT_LT(worst(rigid(J, B), plant::run({J, B, {}, {}}, 2, 1e-3, SIZE)), 1e-4); }

TEST(SimulateEffects, coulomb_sticks_and_slips) {
  auto m = rigid(J, B);
  add(m, "coulomb", {{"tau_c_Nm", 0.02}});
  EXPECT_LT(worst(m, plant::run({J, B, {}, [](double, double, int, double, double) { return 0.02; }}, 2, 1e-3, SIZE)), 3e-3);
}

TEST(SimulateEffects, stribeck) {
  auto m = rigid(J, B);
  add(m, "stribeck", {{"tau_c_Nm", 0.012}, {"tau_s_Nm", 0.02}, {"omega_s_rad_s", 3.0}});
  EXPECT_LT(worst(m, plant::run({J, B, {}, [](double, double w, int, double, double) { return 0.012 + 0.008 * std::exp(-w * w / 9.0); }}, 2, 1e-3, SIZE)), 3e-3);
}

TEST(SimulateEffects, asymmetric_friction) {
  auto m = rigid(J, B);
  add(m, "asymmetric_friction", {{"tau_c_pos_Nm", 0.02}, {"tau_c_neg_Nm", 0.01}, {"dB_Nms_rad", 1e-5}});
  EXPECT_LT(worst(m, plant::run({J, B, [](double, double w, double, double) { return 1e-5 * std::fabs(w); }, [](double, double, int side, double, double) { return side > 0 ? 0.02 : 0.01; }}, 2, 1e-3, SIZE)), 3e-3);
}

TEST(SimulateEffects, load_dependent_friction) {
  auto m = rigid(J, B);
  add(m, "load_dependent_friction", {{"mu", 0.2}});
  EXPECT_LT(worst(m, plant::run({J, B, {}, [](double, double, int, double, double u) { return 0.2 * std::fabs(u); }}, 2, 1e-3, SIZE)), 3e-3);
}

TEST(SimulateEffects, quadratic_drag) {
  auto m = rigid(J, B);
  add(m, "quadratic_drag", {{"c_Nms2_rad2", 2e-6}});
  EXPECT_LT(worst(m, plant::run({J, B, [](double, double w, double, double) { return 2e-6 * w * std::fabs(w); }, {}}, 2, 1e-3, SIZE)), 3e-3);
}

TEST(SimulateEffects, constant_load) {
  auto m = rigid(J, B);
  add(m, "constant_load", {{"tau_0_Nm", 0.004}});
  EXPECT_LT(worst(m, plant::run({J, B, [](double, double, double, double) { return 0.004; }, {}}, 2, 1e-3, SIZE)), 3e-3);
}

TEST(SimulateEffects, gravity_unbalance) {
  auto m = rigid(J, B);
  add(m, "gravity_unbalance", {{"tau_g_Nm", 0.03}, {"theta_0_rad", 0.4}});
  EXPECT_LT(worst(m, plant::run({J, B, [](double th, double, double, double) { return 0.03 * std::sin(th - 0.4); }, {}}, 1, 1e-3, 0.02)), 3e-3);
}

TEST(SimulateEffects, cogging) {
  auto m = rigid(J, B);
  add(m, "cogging", {{"N", 12}, {"A_Nm", 0.01}, {"phi_rad", 0.7}});
  EXPECT_LT(worst(m, plant::run({J, B, [](double th, double, double, double) { return 0.01 * std::sin(12 * th + 0.7); }, {}}, 0.5, 1e-3, SIZE)), 3e-3);
}

TEST(SimulateEffects, torque_ripple) {
  auto m = rigid(J, B);
  add(m, "torque_ripple", {{"N", 6}, {"a", 0.2}, {"phi_rad", -0.7}});
  EXPECT_LT(worst(m, plant::run({J, B, [](double th, double, double, double u) { return 0.2 * u * std::sin(6 * th - 0.7); }, {}}, 0.5, 1e-3, SIZE)), 3e-3);
}

TEST(SimulateEffects, eccentric_friction) {
  auto m = rigid(J, B);
  add(m, "eccentric_friction", {{"tau_c_Nm", 0.015}, {"e", 0.5}, {"n", 1}, {"phi_rad", 1.0}});
  EXPECT_LT(worst(m, plant::run({J, B, {}, [](double th, double, int, double, double) { return 0.015 * (1 + 0.5 * std::cos(th + 1.0)); }}, 2, 1e-3, SIZE)), 5e-3);
}

TEST(SimulateEffects, friction_drift) {
  auto m = rigid(J, B);
  add(m, "coulomb", {{"tau_c_Nm", 0.02}});
  add(m, "friction_drift", {{"dtau_c_Nm", -0.01}, {"dB_Nms_rad", 0.0}, {"T_w_s", 1.0}});
  EXPECT_LT(worst(m, plant::run({J, B, {}, [](double, double, int, double t, double) { return 0.02 - 0.01 * (1 - std::exp(-t)); }}, 2, 1e-3, SIZE)), 3e-3);
}

TEST(SimulateEffects, torque_saturation) {
  auto m = rigid(J, B);
  add(m, "torque_saturation", {{"i_10_Nm", 0.04}, {"p", 2.0}});
  EXPECT_LT(worst(m, plant::run({J, B, [](double, double, double, double u) { return 0.1 * u * std::pow(std::fabs(u) / 0.04, 2); }, {}}, 2, 1e-3, SIZE)), 3e-3);
}

TEST(SimulateEffects, dead_zone) {
  auto m = rigid(J, B);
  add(m, "dead_zone", {{"u_d_Nm", 0.01}});
  EXPECT_LT(worst(m, plant::run({J, B, [](double, double, double, double u) { return std::min(std::fabs(u), 0.01) * sgn(u); }, {}}, 2, 1e-3, SIZE)), 3e-3);
}

TEST(SimulateEffects, inertia_change) {
  auto m = rigid(J, B);
  add(m, "inertia_change", {{"dJ_kgm2", 5e-5}, {"t_step_s", 0.7}});
  plant::Run r;
  double th = 0, w = 0;
  for (int k = 0; k < 2000; k++) {
    const double u = plant::input(k * 1e-3, SIZE);
    r.t.push_back(k * 1e-3), r.u.push_back(u), r.angle.push_back(th), r.speed.push_back(w);
    for (int j = 0; j < 400; j++) w += 2.5e-6 * (u - B * w) / (k * 1e-3 + j * 2.5e-6 >= 0.7 ? J + 5e-5 : J), th += 2.5e-6 * w;
  }
  EXPECT_LT(worst(m, r), 3e-3);
}

TEST(SimulateEffects, delay_keeps_the_fraction_of_a_sample) {
  auto m = rigid(J, B);
  add(m, "delay", {{"T_d_s", 2.35e-3}});
  plant::Run r;
  double th = 0, w = 0;
  for (int k = 0; k < 2000; k++) {
    r.t.push_back(k * 1e-3), r.u.push_back(plant::input(k * 1e-3, SIZE)), r.angle.push_back(th), r.speed.push_back(w);
    for (int j = 0; j < 400; j++) {
      const double t = k * 1e-3 + j * 2.5e-6 - 2.35e-3;
      const double u = plant::input(std::max(0.0, std::floor(t * 1e3 + 1e-9) * 1e-3), SIZE);
      w += 2.5e-6 * (u - B * w) / J, th += 2.5e-6 * w;
    }
  }
  EXPECT_LT(worst(m, r), 1e-3);
}

TEST(SimulateEffects, hysteresis) {
  auto m = rigid(J, B);
  add(m, "hysteresis", {{"tau_h_Nm", 0.02}, {"theta_h_rad", 0.1}});
  plant::Run r;
  double th = 0, w = 0, z = 0;
  for (int k = 0; k < 2000; k++) {
    const double u = plant::input(k * 1e-3, SIZE), h = 2.5e-6;
    r.t.push_back(k * 1e-3), r.u.push_back(u), r.angle.push_back(th), r.speed.push_back(w);
    for (int j = 0; j < 400; j++) w += h * (u - B * w - 0.02 * z) / J, z += h * (w - std::fabs(w) * z) / 0.1, th += h * w;
  }
  EXPECT_LT(worst(m, r), 5e-3);
}

TEST(SimulateEffects, lugre) {
  const double tc = 0.012, ts = 0.018, ws = 3, s0 = 40, s1 = 0.02;
  auto m = rigid(J, B);
  add(m, "lugre", {{"tau_c_Nm", tc}, {"tau_s_Nm", ts}, {"omega_s_rad_s", ws}, {"sigma_0_Nm_rad", s0}, {"sigma_1_Nms_rad", s1}});
  plant::Run r;
  double th = 0, w = 0, z = 0;
  for (int k = 0; k < 2000; k++) {
    const double u = plant::input(k * 1e-3, SIZE), h = 1e-6;
    r.t.push_back(k * 1e-3), r.u.push_back(u), r.angle.push_back(th), r.speed.push_back(w);
    for (int j = 0; j < 1000; j++) {
      const double g = tc + (ts - tc) * std::exp(-w * w / (ws * ws)), dz = w - s0 * std::fabs(w) * z / g;
      w += h * (u - B * w - s0 * z - s1 * dz) / J, z += h * dz, th += h * w;
    }
  }
  EXPECT_LT(worst(m, r), 1e-2);
}

namespace {
plant::Run two_masses(double Jm, double Jl, double k, double d, double gap, std::vector<double> *load = nullptr) {
  plant::Run r;
  double th = 0, w = 0, tl = 0, wl = 0;
  for (int row = 0; row < 2000; row++) {
    const double u = plant::input(row * 1e-3, SIZE), h = 1e-6;
    r.t.push_back(row * 1e-3), r.u.push_back(u), r.angle.push_back(th), r.speed.push_back(w);
    if (load) load->push_back(tl);
    for (int j = 0; j < 1000; j++) {
      const double x = th - tl, y = x > gap / 2 ? x - gap / 2 : x < -gap / 2 ? x + gap / 2 : 0;
      const double s = y != 0 || gap == 0 ? k * y + d * (w - wl) : 0;
      w += h * (u - B * w - s) / Jm, wl += h * s / Jl, th += h * w, tl += h * wl;
    }
  }
  return r;
}
}  // namespace

TEST(SimulateEffects, compliance) {
  auto m = rigid(J, B);
  add(m, "compliance", {{"J_l_kgm2", 6e-5}, {"k_Nm_rad", 2.0}, {"d_Nms_rad", 5e-4}});
  EXPECT_LT(worst(m, two_masses(4e-5, 6e-5, 2.0, 5e-4, 0)), 1e-3);
}

TEST(SimulateEffects, backlash) {
  auto m = rigid(J, B);
  add(m, "backlash", {{"gap_rad", 0.05}, {"J_l_kgm2", 6e-5}, {"k_Nm_rad", 10.0}, {"d_Nms_rad", 5e-3}});
  EXPECT_LT(worst(m, two_masses(4e-5, 6e-5, 10.0, 5e-3, 0.05)), 1e-2);
}

TEST(SimulateEffects, encoder_eccentricity) {
  auto m = rigid(J, B);
  add(m, "encoder_eccentricity", {{"a_rad", 0.02}, {"phi_rad", 0.5}});
  auto r = plant::run({J, B, {}, {}}, 2, 1e-3, SIZE);
  for (size_t k = 0; k < r.t.size(); k++) {
    const double th = r.angle[k];
    r.angle[k] = th + 0.02 * std::sin(th + 0.5);
    r.speed[k] *= 1 + 0.02 * std::cos(th + 0.5);
  }
  EXPECT_LT(worst(m, r), 1e-3);
}

TEST(SimulateEffects, own_formula_with_a_side_at_rest) {
  auto m = rigid(J, B);
  char reason[256];
  ASSERT_EQ(driveid_model_add(&m, "mine", "c * sign(omega_rad_s) * (1 + 0.3*cos(theta_rad)^2)", "tau_Nm", reason, sizeof reason), DRIVEID_OK) << reason;
  m.effect[0].param[0].state = DRIVEID_PARAM_FREE;
  m.effect[0].param[0].value = 0.015;
  EXPECT_LT(worst(m, plant::run({J, B, {}, [](double th, double, int, double, double) { return 0.015 * (1 + 0.3 * std::cos(th) * std::cos(th)); }}, 2, 1e-3, SIZE)), 5e-3);
}
