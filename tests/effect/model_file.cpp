// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstring>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include <driveid/model_file.h>

namespace {

std::string refused(const std::string &text, driveid_status expected = DRIVEID_ERR_FORMAT) {
  driveid_model m;
  char message[400] = "";
  EXPECT_EQ(driveid_model_read(text.c_str(), &m, message, sizeof message), expected) << text;
  return message;
}

driveid_model read(const std::string &text) {
  driveid_model m = {};
  char message[400] = "";
  EXPECT_EQ(driveid_model_read(text.c_str(), &m, message, sizeof message), DRIVEID_OK) << message;
  return m;
}

std::string write(const driveid_model &m, const char *history = nullptr) {
  char *text = nullptr;
  EXPECT_EQ(driveid_model_write(&m, history, &text), DRIVEID_OK);
  std::string s = text ? text : "";
  driveid_text_free(text);
  return s;
}

const std::string kHead = "format = 1\nstructure = \"rigid_axis\"\n";

}  // namespace

TEST(ModelFile, reads_the_documented_example) {
  const driveid_model m = read(kHead +
      "[parameters.J_kgm2]\nvalue = 1.2e-4\ninterval = [1.19e-4, 1.21e-4]\nunit = \"kg m^2\"\nstate = \"free\"\n"
      "[[effect]]\nname = \"coulomb\"\nparameters.tau_c_Nm = { value = 0.01, interval = [0.009, 0.011], unit = \"N m\", state = \"free\" }\n"
      "[[effect]]\nname = \"my_drag\"\nformula = \"c * omega_rad_s * cos(3*theta_rad)\"\nadds_to = \"tau_Nm\"\n"
      "[[history]]\nstep = \"add coulomb\"\n");
  EXPECT_EQ(m.structure, DRIVEID_STRUCTURE_RIGID_AXIS);
  EXPECT_EQ(driveid_model_param(&m, "J_kgm2")->value, 1.2e-4);
  EXPECT_EQ(driveid_model_param(&m, "B_Nms_rad")->state, DRIVEID_PARAM_UNSET);
  ASSERT_EQ(m.effects, 2u);
  EXPECT_EQ(m.effect[0].param[0].hi, 0.011);
  EXPECT_STREQ(m.effect[1].param[0].name, "c");
}

TEST(ModelFile, a_formula_names_its_equation_on_its_left_side) {
  const driveid_model m = read(kHead + "[[effect]]\nname = \"mine\"\nformula = \" tau_Nm  = c * omega_rad_s\"\n");
  EXPECT_STREQ(m.effect[0].adds_to, "tau_Nm");
  EXPECT_STREQ(m.effect[0].formula, "c * omega_rad_s");
  EXPECT_STREQ(m.effect[0].param[0].name, "c");
}

TEST(ModelFile, names_tell_the_frame) {
  const driveid_model m = read("format = 1\nstructure = \"rigid_axis\"\n[parameters.J_As2_rad]\nvalue = 1\n[[effect]]\nname = \"coulomb\"\nparameters.tau_c_A = { value = 0.2 }\n");
  EXPECT_EQ(driveid_model_frame(&m), DRIVEID_FRAME_AMPERE);
  EXPECT_NE(driveid_model_param(&m, "B_As_rad"), nullptr);
}

TEST(ModelFile, complaints_name_line_key_and_mend) {
  EXPECT_NE(refused("structure = \"rigid_axis\"").find("format = 1"), std::string::npos);
  EXPECT_NE(refused("format = 2\nstructure = \"rigid_axis\"").find("line 1"), std::string::npos);
  EXPECT_NE(refused("format = 1\nstructure = \"rigid\"").find("known are rigid_axis"), std::string::npos);
  EXPECT_NE(refused(kHead + "colour = 3").find("line 3: unknown key \"colour\""), std::string::npos);
  EXPECT_NE(refused(kHead + "[parameters.J]\nvalue = 1").find("known are J_kgm2"), std::string::npos);
  EXPECT_NE(refused(kHead + "[parameters.J_kgm2]\nvalue = \"x\"").find("line 4: parameters.J_kgm2.value must be a finite number"), std::string::npos);
  EXPECT_NE(refused(kHead + "[parameters.J_kgm2]\nvalue = nan").find("finite"), std::string::npos);
  EXPECT_NE(refused(kHead + "[parameters.J_kgm2]\nvalue = 1\nunit = \"g cm^2\"").find("convert"), std::string::npos);
  EXPECT_NE(refused(kHead + "[parameters.J_kgm2]\nvalue = 1\ninterval = [2, 1]").find("[lower, upper]"), std::string::npos);
  EXPECT_NE(refused(kHead + "[parameters.J_kgm2]\nvalue = 1\nstate = \"fixed\"").find("\"free\", \"given\" or \"unset\""), std::string::npos);
  EXPECT_NE(refused(kHead + "[parameters.J_kgm2]\nstate = \"free\"").find("has no value"), std::string::npos);
  EXPECT_NE(refused(kHead + "[[effect]]\nname = \"colomb\"").find("driveid catalogue"), std::string::npos);
  EXPECT_NE(refused(kHead + "[[effect]]\nname = \"mine\"\nformula = \"c*\"\nadds_to = \"tau_Nm\"").find("column 3"), std::string::npos);
  EXPECT_NE(refused(kHead + "[[effect]]\nname = \"mine\"\nformula = \"c\"").find("write formula = \"tau_Nm"), std::string::npos);
  EXPECT_NE(refused(kHead + "[[effect]]\nname = \"mine\"\nformula = \"v_V = c\"\nadds_to = \"tau_Nm\"").find("names another"), std::string::npos);
  EXPECT_NE(refused(kHead + "[[effect]]\nname = \"mine\"\nformula = \"c\"\nadds_to = \"torque\"").find("adds_to"), std::string::npos);
  EXPECT_NE(refused(kHead + "[[effect]]\nname = \"coulomb\"\nparameters.tau = { value = 1 }").find("known are tau_c_Nm"), std::string::npos);
  EXPECT_NE(refused(kHead + "[[effect]]\nname = \"coulomb\"\n[[effect]]\nname = \"coulomb\"").find("already"), std::string::npos);
  EXPECT_NE(refused(kHead + "[[effect]]\nname = \"dead_time_voltage\"").find("no place"), std::string::npos);
  EXPECT_NE(refused("format = 1\nstructure = \"linear_axis\"\n[[effect]]\nname = \"gravity_unbalance\"").find("linear"), std::string::npos);
  EXPECT_NE(refused("format = 1\nstructure = \"rigid_axis\n").find("line 2"), std::string::npos);
  EXPECT_NE(refused(kHead + "[parameters.K_t_Nm_A]\nvalue = 0.05\nstate = \"free\"").find("only be given"), std::string::npos);
}

// Written and read back: the same numbers to the last bit, whatever they are.
TEST(ModelFile, roundtrip_is_exact) {
  std::mt19937_64 random(11);
  auto any = [&] {
    for (;;) {
      const uint64_t bits = random();
      double v;
      std::memcpy(&v, &bits, sizeof v);
      if (std::isfinite(v)) return v;
    }
  };
  for (int round = 0; round < 300; round++) {
    driveid_model m;
    driveid_model_init(&m, static_cast<driveid_structure>(round % DRIVEID_STRUCTURE_COUNT));
    char reason[200];
    for (uint32_t k = 0; k < driveid_effect_count(); k++)
      if (random() % 3 == 0) driveid_model_add(&m, driveid_effect_at(k)->name, nullptr, nullptr, reason, sizeof reason);
    if (round % 4 == 0) driveid_model_add(&m, "own one", "a*sin(b*theta_rad)", round % 8 ? "tau_Nm" : "v_V", reason, sizeof reason);
    auto fill = [&](driveid_param &p) {
      p.state = static_cast<driveid_param_state>(random() % 3);
      if (p.state == DRIVEID_PARAM_UNSET) return;
      p.value = any();
      p.lo = p.state == DRIVEID_PARAM_FREE ? std::nextafter(p.value, -INFINITY) : p.value;
      p.hi = p.state == DRIVEID_PARAM_FREE && p.value < 1e300 ? p.value + std::fabs(p.value) : p.value;
    };
    for (uint32_t k = 0; k < m.params; k++) fill(m.param[k]);
    for (uint32_t e = 0; e < m.effects; e++)
      for (uint32_t k = 0; k < m.effect[e].params; k++) fill(m.effect[e].param[k]);
    const std::string text = write(m);
    const driveid_model back = read(text);
    ASSERT_EQ(write(back), text);
    ASSERT_EQ(back.params, m.params);
    for (uint32_t k = 0; k < m.params; k++) {
      EXPECT_EQ(back.param[k].value, m.param[k].value) << text;
      EXPECT_EQ(back.param[k].lo, m.param[k].lo);
      EXPECT_EQ(back.param[k].hi, m.param[k].hi);
      EXPECT_EQ(back.param[k].state, m.param[k].state);
      EXPECT_STREQ(back.param[k].name, m.param[k].name);
    }
    ASSERT_EQ(back.effects, m.effects);
    for (uint32_t e = 0; e < m.effects; e++) EXPECT_STREQ(back.effect[e].formula, m.effect[e].formula);
  }
}

TEST(ModelFile, history_is_kept) {
  driveid_model m;
  driveid_model_init(&m, DRIVEID_STRUCTURE_LINEAR_AXIS);
  const std::string text = write(m, "[[history]]\nstep = \"fit\"\nfree_run = { rmse = 0.004, unit = \"m\" }\n[[history]]\nstep = \"add coulomb\"");
  char *history = nullptr, message[100];
  ASSERT_EQ(driveid_model_history(text.c_str(), &history, message, sizeof message), DRIVEID_OK);
  const std::string again = write(read(text), history);
  EXPECT_NE(again.find("add coulomb"), std::string::npos);
  EXPECT_NE(again.find("0.004"), std::string::npos);
  driveid_text_free(history);
}

TEST(ModelFile, mutations_of_a_file_never_break_the_reader) {
  std::mt19937 random(13);
  driveid_model m;
  driveid_model_init(&m, DRIVEID_STRUCTURE_DC_DRIVE);
  char reason[200];
  driveid_model_give(&m, "R_ohm", 1.5);
  driveid_model_add(&m, "stribeck", nullptr, nullptr, reason, sizeof reason);
  driveid_model_add(&m, "own", "c*omega_rad_s^3", "tau_Nm", reason, sizeof reason);
  const std::string seed = write(m);
  for (int round = 0; round < 3000; round++) {
    std::string text = seed;
    for (unsigned k = 0; k < 1 + random() % 5; k++) {
      const std::size_t at = random() % text.size();
      if (random() % 3 == 0) text.erase(at, random() % 9);
      else text[at] = char(random() % 127 + 1);
      if (text.empty()) text = " ";
    }
    driveid_model out;
    char message[300];
    const driveid_status s = driveid_model_read(text.c_str(), &out, message, sizeof message);
    ASSERT_TRUE(s == DRIVEID_OK || (s == DRIVEID_ERR_FORMAT && message[0]));
  }
}

// Letters that toml++ 3.3 has no defined answer for (cmake/include/tomlpp.hpp), where it looks for a blank.
TEST(ModelFile, LettersBeyondAsciiAreRefusedWithTheirLine) {
  driveid_model out;
  char message[300];
  for (const char *text : {"format = 1\n[cont\xcb\x90]\n", "format = 1\n\xc3\xa4 = 2\n", "format = 1\na =0\"x\xd1\x8c\x1d\n"}) {
    EXPECT_EQ(driveid_model_read(text, &out, message, sizeof message), DRIVEID_ERR_FORMAT);
    EXPECT_TRUE(std::string(message).starts_with("line 2: ")) << message;
  }
}
