// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstring>
#include <random>
#include <set>
#include <string>

#include <gtest/gtest.h>

#include <driveid/effect.h>

namespace {
const char *const kCanonical[] = {"coulomb", "stribeck", "lugre", "asymmetric_friction", "load_dependent_friction", "quadratic_drag", "constant_load", "gravity_unbalance",
                                  "cogging", "torque_ripple", "eccentric_friction", "backlash", "compliance", "delay", "torque_saturation", "resistance_drift",
                                  "dead_time_voltage", "current_offset", "encoder_eccentricity", "inertia_change", "friction_drift", "hysteresis", "dead_zone"};
}

TEST(Catalogue, holds_every_canonical_name_once) {
  std::set<std::string> found;
  for (uint32_t k = 0; k < driveid_effect_count(); k++) found.insert(driveid_effect_at(k)->name);
  EXPECT_EQ(driveid_effect_count(), 23u);
  for (const char *name : kCanonical) EXPECT_TRUE(found.count(name)) << name;
  EXPECT_EQ(driveid_effect_at(23), nullptr);
  EXPECT_EQ(driveid_effect_find("nonsense"), nullptr);
  EXPECT_EQ(driveid_effect_find(nullptr), nullptr);
}

TEST(Catalogue, every_entry_is_complete) {
  for (uint32_t k = 0; k < driveid_effect_count(); k++) {
    const driveid_effect_info &e = *driveid_effect_at(k);
    EXPECT_TRUE(e.equation && e.signature && e.separated_by && e.literature) << e.name;
    EXPECT_TRUE(e.params > 0 && e.domains && e.confused_with[0]) << e.name;
    EXPECT_EQ(e.columns > 0, e.fill != nullptr) << e.name;
    for (int n = 0; n < DRIVEID_EFFECT_NAMES_MAX; n++) {
      if (e.confused_with[n]) { EXPECT_NE(driveid_effect_find(e.confused_with[n]), nullptr) << e.name; EXPECT_STRNE(e.confused_with[n], e.name); }
      if (e.subsumes[n]) EXPECT_NE(driveid_effect_find(e.subsumes[n]), nullptr) << e.name;
    }
    for (uint32_t p = 0; p < e.params; p++) {
      EXPECT_TRUE(e.param[p].symbol && e.param[p].text) << e.name;
      EXPECT_LE(e.param[p].lo, e.param[p].typical) << e.name << " " << e.param[p].symbol;
      EXPECT_GE(e.param[p].hi, e.param[p].typical) << e.name << " " << e.param[p].symbol;
    }
  }
}

TEST(Catalogue, names_and_units_follow_the_frame) {
  const driveid_effect_info *stribeck = driveid_effect_find("stribeck"), *dead_zone = driveid_effect_find("dead_zone");
  char name[40], unit[40];
  const struct { driveid_frame frame; const char *name, *unit; } cases[] = {{DRIVEID_FRAME_TORQUE, "tau_c_Nm", "N m"}, {DRIVEID_FRAME_FORCE, "F_c_N", "N"}, {DRIVEID_FRAME_AMPERE, "tau_c_A", "A"}, {DRIVEID_FRAME_AMPERE_LINEAR, "F_c_A", "A"}, {DRIVEID_FRAME_VOLT, "tau_c_V", "V"}};
  for (const auto &c : cases) {
    ASSERT_EQ(driveid_effect_param_name(stribeck, 0, c.frame, 'A', name, sizeof name), DRIVEID_OK);
    ASSERT_EQ(driveid_effect_param_unit(stribeck, 0, c.frame, 'A', unit, sizeof unit), DRIVEID_OK);
    EXPECT_STREQ(name, c.name);
    EXPECT_STREQ(unit, c.unit);
  }
  driveid_effect_param_name(dead_zone, 0, DRIVEID_FRAME_TORQUE, 'N', name, sizeof name);
  EXPECT_STREQ(name, "u_d_Nm");
  driveid_effect_param_name(dead_zone, 0, DRIVEID_FRAME_VOLT, 'V', name, sizeof name);
  EXPECT_STREQ(name, "u_d_V");
  EXPECT_EQ(driveid_effect_param_name(dead_zone, 1, DRIVEID_FRAME_VOLT, 'V', name, sizeof name), DRIVEID_ERR_ARGUMENT);
}

// Published parameters -> (shape, linear) -> published is the identity inside the bounds.
TEST(Catalogue, publish_and_resolve_are_inverse) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> u(0.2, 0.9);
  for (uint32_t k = 0; k < driveid_effect_count(); k++) {
    const driveid_effect_info &e = *driveid_effect_at(k);
    if (!e.resolve) continue;
    for (int round = 0; round < 50; round++) {
      double p[DRIVEID_EFFECT_PARAMS_MAX] = {}, back[DRIVEID_EFFECT_PARAMS_MAX] = {}, shape[DRIVEID_EFFECT_SHAPES_MAX] = {}, linear[DRIVEID_EFFECT_COLUMNS_MAX] = {};
      for (uint32_t j = 0; j < e.params; j++) p[j] = e.param[j].dimension == DRIVEID_DIM_PHASE ? 2 * u(random) - 1 : (e.param[j].typical != 0 ? e.param[j].typical : 1) * u(random);
      if (!std::strcmp(e.name, "gravity_unbalance")) p[0] = std::fabs(p[0]);
      ASSERT_EQ(driveid_effect_resolve(&e, p, 0.05, shape, linear), DRIVEID_OK);
      ASSERT_EQ(driveid_effect_publish(&e, shape, linear, 0.05, back), DRIVEID_OK);
      for (uint32_t j = 0; j < e.params; j++) EXPECT_NEAR(back[j], p[j], 1e-9 * std::fabs(p[j]) + 1e-15) << e.name << " " << e.param[j].symbol;
    }
  }
}

// Columns times linear values equal the published equation, written out here from CONTRACT.
TEST(Catalogue, columns_give_the_published_equation) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> u(-1, 1);
  for (int round = 0; round < 200; round++) {
    driveid_effect_state s = {};
    s.angle = 10 * u(random), s.speed = 20 * u(random), s.direction = (s.speed > 0) - (s.speed < 0), s.drive = 3 * u(random), s.gain = 0.05, s.torque = s.gain * s.drive;
    auto loss = [&](const char *name, std::initializer_list<double> params) {
      const driveid_effect_info *e = driveid_effect_find(name);
      double p[DRIVEID_EFFECT_PARAMS_MAX] = {}, shape[4] = {}, linear[4] = {}, column[4] = {}, memory[4] = {}, sum = 0;
      std::copy(params.begin(), params.end(), p);
      EXPECT_EQ(driveid_effect_resolve(e, p, s.gain, shape, linear), DRIVEID_OK);
      EXPECT_EQ(driveid_effect_columns(e, shape, &s, memory, column), DRIVEID_OK);
      for (int c = 0; c < e->columns; c++) sum += linear[c] * column[c];
      return sum;
    };
    const double w = s.speed, d = s.direction, th = s.angle, i = s.drive, eps = 1e-12;
    EXPECT_NEAR(loss("coulomb", {0.3}), 0.3 * d, eps);
    EXPECT_NEAR(loss("stribeck", {0.3, 0.5, 4}), (0.3 + 0.2 * std::exp(-w * w / 16)) * d, eps);
    EXPECT_NEAR(loss("asymmetric_friction", {0.3, 0.2, 0.01}), (d > 0 ? 0.3 : -0.2) + 0.01 * std::fabs(w), eps);
    EXPECT_NEAR(loss("load_dependent_friction", {0.2}), 0.2 * std::fabs(0.05 * i) * d, eps);
    EXPECT_NEAR(loss("quadratic_drag", {0.02}), 0.02 * w * std::fabs(w), eps);
    EXPECT_NEAR(loss("gravity_unbalance", {0.3, 0.4}), 0.3 * std::sin(th - 0.4), eps);
    EXPECT_NEAR(loss("cogging", {7, 0.1, 0.4}), 0.1 * std::sin(7 * th + 0.4), eps);
    EXPECT_NEAR(loss("torque_ripple", {6, 0.1, 0.4}), 0.1 * 0.05 * i * std::sin(6 * th + 0.4), eps);
    EXPECT_NEAR(loss("eccentric_friction", {0.3, 0.5, 2, 0.4}), 0.3 * (1 + 0.5 * std::cos(2 * th + 0.4)) * d, eps);
    EXPECT_NEAR(loss("torque_saturation", {2.0, 1.5}), 0.05 * i * 0.1 * std::pow(std::fabs(i) / 2.0, 1.5), eps);
    EXPECT_NEAR(loss("dead_zone", {0.4}), 0.05 * std::max(-0.4, std::min(0.4, i)), eps);
    EXPECT_NEAR(loss("current_offset", {0.2}), 0.05 * 0.2, eps);
  }
}

// A bristle advanced in one long step equals the same motion in many short ones: no step is too stiff.
TEST(Catalogue, bristle_memory_is_exact_for_constant_speed) {
  for (const char *name : {"lugre", "hysteresis"}) {
    const driveid_effect_info *e = driveid_effect_find(name);
    double shape[4] = {3, 1.5, 1e-4, 0}, one[4] = {}, many[4] = {}, a[4], b[4];
    if (e->shapes == 1) shape[0] = 1e-4;
    driveid_effect_state s = {};
    s.speed = 2, s.dt_s = 0.01;
    driveid_effect_columns(e, shape, &s, one, a);
    s.dt_s = 1e-6;
    for (int k = 0; k < 10000; k++) driveid_effect_columns(e, shape, &s, many, b);
    EXPECT_NEAR(one[0], many[0], 1e-9);
    EXPECT_TRUE(std::isfinite(a[0]));
  }
}
