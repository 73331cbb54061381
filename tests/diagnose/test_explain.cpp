// SPDX-License-Identifier: Apache-2.0
// Explain end to end through the C interface, on drives of the tests' own and on a real machine.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "axis.hpp"

using nlohmann::json;

namespace {

std::string new_model(const char *structure, std::vector<const char *> given) {
  char *toml = nullptr, message[200];
  EXPECT_EQ(driveid_new(structure, given.data(), given.size(), &toml, message, sizeof message), DRIVEID_OK) << message;
  std::string text = toml ? toml : "";
  driveid_text_free(toml);
  return text;
}

json explained(const std::string &toml, const driveid_record &training, const driveid_record *held, driveid_status expected = DRIVEID_OK) {
  driveid_task task{};
  task.model_toml = toml.c_str();
  task.training = &training;
  task.trainings = 1;
  task.held_out = held;
  task.held_outs = held ? 1 : 0;
  task.options_json = "{\"errors\": false}";
  char *text = nullptr, message[300] = "";
  EXPECT_EQ(driveid_explain(&task, &text, message, sizeof message), expected) << message;
  json j = text ? json::parse(text) : json::object();
  driveid_text_free(text);
  return j;
}

json explain_axis(const Axis &axis, unsigned seed) {
  Log a = run_axis(axis, 14, seed), b = run_axis(axis, 10, seed + 100);
  a.seal("training");
  b.seal("held out");
  return explained(new_model("rigid_axis", {"K_t_Nm_A=0.08"}), a.record, &b.record);
}

}  // namespace

TEST(Explain, CompleteModelLacksNothing) {
  json j = explain_axis({}, 1);
  EXPECT_EQ(j["verdict"], "nothing_missing") << j["ranked"].dump(1);
  EXPECT_TRUE(j["ranked"].empty());
}

TEST(Explain, CoulombIsFoundWithItsSize) {
  Axis axis;
  axis.coulomb = 0.012;
  json j = explain_axis(axis, 2);
  ASSERT_FALSE(j["ranked"].empty());
  EXPECT_EQ(j["ranked"][0]["effect"], "coulomb");
  bool widened = false;
  for (auto &n : j["notices"]) widened |= n["kind"] == "chosen";   // the choice among the catalogue is paid for, and said
  EXPECT_TRUE(widened);
  EXPECT_NEAR(j["ranked"][0]["parameters"]["tau_c_Nm"]["value"].get<double>(), 0.012, 0.0012);   // a tenth: stiction rows are left out, noise is 1 % of rated
}

// Coulomb stands in the model: a richer law takes its place there, it is not added beside it.
TEST(Explain, RicherFrictionTakesThePlaceOfCoulomb) {
  char *toml = nullptr, message[200];
  ASSERT_EQ(driveid_add(new_model("rigid_axis", {"K_t_Nm_A=0.08"}).c_str(), "coulomb", &toml, message, sizeof message), DRIVEID_OK) << message;
  std::string text = toml;
  driveid_text_free(toml);
  ASSERT_EQ(driveid_add(text.c_str(), "stribeck", &toml, message, sizeof message), DRIVEID_OK) << message;
  text = toml;
  driveid_text_free(toml);
  EXPECT_EQ(text.find("\"coulomb\""), std::string::npos) << text;
  EXPECT_NE(text.find("\"stribeck\""), std::string::npos) << text;
}

// Real stiction at every reversal, and dry friction in the model: smoothing must not turn the jump of friction into a bristle.
TEST(Explain, KnownDryFrictionLacksNothing) {
  for (unsigned seed : {11u, 12u}) {
    Axis axis;
    axis.coulomb = 0.012;
    Log a = run_axis(axis, 14, seed), b = run_axis(axis, 10, seed + 100);
    a.seal("training");
    b.seal("held out");
    char *toml = nullptr, message[200];
    ASSERT_EQ(driveid_add(new_model("rigid_axis", {"K_t_Nm_A=0.08"}).c_str(), "coulomb", &toml, message, sizeof message), DRIVEID_OK) << message;
    const std::string text = toml;
    driveid_text_free(toml);
    json j = explained(text, a.record, &b.record);
    EXPECT_EQ(j["verdict"], "nothing_missing") << seed << j["ranked"].dump(1);
  }
}

// A threshold of one and a half times the current's noise: it shows in the deficit above it.
TEST(Explain, DeadZoneNearTheNoiseIsFound) {
  Axis axis;
  axis.sigma_i = 0.03;
  axis.dead_zone_A = 0.045;
  json j = explain_axis(axis, 13);
  ASSERT_FALSE(j["ranked"].empty());
  EXPECT_EQ(j["ranked"][0]["effect"], "dead_zone") << j["ranked"].dump(1);
  EXPECT_NEAR(j["ranked"][0]["parameters"]["u_d_A"]["value"].get<double>(), 0.045, 0.009);   // a fifth: the threshold is judged by an averaged current
}

// A current that is mostly noise: what a threshold would swallow of it explains nothing.
TEST(Explain, NoiseOfTheCurrentIsNoDeadZone) {
  Axis axis;
  axis.sigma_i = 0.3;
  json j = explain_axis(axis, 14);
  for (auto &r : j["ranked"]) EXPECT_FALSE(r["accepted"].get<bool>()) << r.dump(1);
}

TEST(Explain, CoggingIsFoundWithItsOrder) {
  Axis axis;
  axis.cogging = 0.006;
  axis.order = 14;
  json j = explain_axis(axis, 3);
  ASSERT_FALSE(j["ranked"].empty());
  EXPECT_EQ(j["ranked"][0]["effect"], "cogging");
  EXPECT_NEAR(j["ranked"][0]["parameters"]["N"]["value"].get<double>(), 14, 0.1);
}

TEST(Explain, LoadAndOffsetCannotBeToldApart) {
  Axis axis;
  axis.load = 0.01;
  json j = explain_axis(axis, 4);
  ASSERT_FALSE(j["ranked"].empty());
  EXPECT_EQ(j["verdict"], "cannot_tell");
  std::vector<std::string> names{j["ranked"][0]["effect"].get<std::string>()};
  for (auto &t : j["ranked"][0]["not_told_apart_from"]) names.push_back(t.get<std::string>());
  EXPECT_NE(std::find(names.begin(), names.end(), "constant_load"), names.end());
  EXPECT_NE(std::find(names.begin(), names.end(), "current_offset"), names.end());
}

TEST(Explain, RestingAxisIsRefused) {
  Log a = run_axis({}, 5, 5);
  for (double &q : a.theta_rad) q = 1;
  a.seal("at rest");
  json j = explained(new_model("rigid_axis", {"K_t_Nm_A=0.08"}), a.record, nullptr, DRIVEID_ERR_DATA);
  EXPECT_EQ(j["verdict"], "bad_data");
  EXPECT_FALSE(j["message"].get<std::string>().empty());
}

// EMPS: from inertia and viscous friction alone, dry friction must be found (published: 20.4 N).
TEST(Explain, EmpsAsksForDryFriction) {
  const char *folder = std::getenv("DRIVEID_DATA");
  const std::string file = std::string(folder ? folder : DRIVEID_DATA_DEFAULT) + "/emps/emps_train.csv";
  std::ifstream in(file);
  if (!in) GTEST_SKIP() << "SKIPPED BECAUSE " << file << " is not there";
  std::string line;
  std::getline(in, line);
  std::vector<std::int64_t> t;
  std::vector<double> x, f;
  while (std::getline(in, line)) {
    std::stringstream s(line);
    std::string cell[6];
    for (auto &c : cell) std::getline(s, c, ',');
    t.push_back(std::llround(std::atof(cell[0].c_str()) * 1e9));
    x.push_back(std::atof(cell[2].c_str()));
    f.push_back(std::atof(cell[4].c_str()));
  }
  driveid_column columns[] = {{"x_m", x.data()}, {"F_N", f.data()}};
  driveid_record record{"emps", nullptr, nullptr, t.size(), 2, t.data(), columns};
  json j = explained(new_model("linear_axis", {}), record, nullptr);
  bool dry = false;
  for (auto &r : j["ranked"])
    if (r["accepted"].get<bool>())
      for (const char *name : {"coulomb", "asymmetric_friction", "stribeck", "lugre", "hysteresis"}) dry |= r["effect"] == name;
  EXPECT_TRUE(dry) << j["ranked"].dump(1);
}
