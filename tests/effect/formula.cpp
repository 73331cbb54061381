// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include <driveid/effect.h>

namespace {

double value(const char *text, const driveid_effect_state &s = {}, std::initializer_list<double> params = {}) {
  driveid_formula f;
  char message[200];
  EXPECT_EQ(driveid_formula_parse(text, &f, message, sizeof message), DRIVEID_OK) << text << ": " << message;
  double p[DRIVEID_FORMULA_PARAMS_MAX] = {};
  std::copy(params.begin(), params.end(), p);
  return driveid_formula_value(&f, &s, p, nullptr);
}

std::string complaint(const std::string &text) {
  driveid_formula f;
  char message[200] = "";
  EXPECT_EQ(driveid_formula_parse(text.c_str(), &f, message, sizeof message), DRIVEID_ERR_FORMAT) << text;
  return message;
}

}  // namespace

TEST(Formula, arithmetic_and_precedence) {
  EXPECT_EQ(value("1+2*3"), 7);
  EXPECT_EQ(value("(1+2)*3"), 9);
  EXPECT_EQ(value("-2^2"), -4);
  EXPECT_EQ(value("2^-1"), 0.5);
  EXPECT_EQ(value("2^3^2"), 512);
  EXPECT_EQ(value("8/4/2"), 1);
  EXPECT_EQ(value("8-4-2"), 2);
  EXPECT_EQ(value("2*-3+4"), -2);
  EXPECT_EQ(value("- -3"), 3);
  EXPECT_EQ(value("+3"), 3);
  EXPECT_EQ(value("1.5e-3*2E3"), 3);
  EXPECT_EQ(value(".5"), 0.5);
  EXPECT_EQ(value("max(1, min(5, 3))"), 3);
  EXPECT_EQ(value("pow(2,10)"), 1024);
  EXPECT_EQ(value("abs(-3)*sign(-2)"), -3);
  EXPECT_DOUBLE_EQ(value("cos(pi)"), std::cos(3.14159265358979323846));
  EXPECT_DOUBLE_EQ(value("tanh(1)+exp(1)+log(2)+sqrt(2)+tan(1)+sin(1)"), std::tanh(1) + std::exp(1) + std::log(2) + std::sqrt(2) + std::tan(1) + std::sin(1));
}

TEST(Formula, signals_parameters_and_linearity) {
  driveid_formula f;
  char message[200];
  ASSERT_EQ(driveid_formula_parse("c * omega_rad_s * cos(n*theta_rad) + d*abs(omega_rad_s) - 2*t_s", &f, message, sizeof message), DRIVEID_OK);
  ASSERT_EQ(f.params, 3u);
  EXPECT_STREQ(f.param[0], "c");
  EXPECT_STREQ(f.param[1], "n");
  EXPECT_STREQ(f.param[2], "d");
  EXPECT_EQ(f.linear_mask, 0b101u);
  driveid_effect_state s = {};
  s.speed = 2, s.angle = 0.3, s.t_s = 5;
  const double p[] = {7, 3, 0.5};
  double column[DRIVEID_FORMULA_PARAMS_MAX];
  EXPECT_DOUBLE_EQ(driveid_formula_columns(&f, &s, p, column), -10);
  EXPECT_NEAR(column[0], 2 * std::cos(0.9), 1e-12);
  EXPECT_EQ(column[1], 0);
  EXPECT_NEAR(column[2], 2, 1e-12);
}

TEST(Formula, product_of_two_parameters_leaves_one_linear) {
  driveid_formula f;
  ASSERT_EQ(driveid_formula_parse("a*b*omega_rad_s", &f, nullptr, 0), DRIVEID_OK);
  EXPECT_EQ(f.linear_mask, 0b01u);
}

TEST(Formula, sign_of_speed_has_a_side_at_rest) {
  driveid_effect_state s = {};
  s.direction = -1;
  EXPECT_EQ(value("sign(omega_rad_s)", s), -1);
  EXPECT_EQ(value("sign(v_m_s)", s), -1);
  EXPECT_EQ(value("sign(omega_rad_s*2)", s), 0);
}

TEST(Formula, bad_instants_are_zero_and_counted) {
  driveid_formula f;
  const driveid_effect_state s = {};
  uint32_t bad = 0;
  for (const char *text : {"1/omega_rad_s", "log(-1)", "sqrt(0-1)", "exp(1e6)", "0/0"}) {
    ASSERT_EQ(driveid_formula_parse(text, &f, nullptr, 0), DRIVEID_OK);
    EXPECT_EQ(driveid_formula_value(&f, &s, nullptr, &bad), 0.0) << text;
  }
  EXPECT_EQ(bad, 5u);
}

TEST(Formula, complaints_name_the_column) {
  EXPECT_NE(complaint("c * omega_rad_s * cos(3*").find("column 25"), std::string::npos);
  EXPECT_NE(complaint("2 $ 3").find("column 3"), std::string::npos);
  EXPECT_NE(complaint("foo(3)").find("no function \"foo\""), std::string::npos);
  EXPECT_NE(complaint("sin + 2").find("in brackets"), std::string::npos);
  EXPECT_NE(complaint("max(1)").find("too few"), std::string::npos);
  EXPECT_NE(complaint("sin(1,2)").find("too many"), std::string::npos);
  EXPECT_NE(complaint("(1+2").find("never closed"), std::string::npos);
  EXPECT_NE(complaint("1+2)").find("never opened"), std::string::npos);
  EXPECT_NE(complaint("1,2").find("comma outside"), std::string::npos);
  EXPECT_NE(complaint("1.2.3").find("not a number"), std::string::npos);
  EXPECT_NE(complaint("").find("value is expected"), std::string::npos);
  EXPECT_NE(complaint("1 2").find("operator is expected"), std::string::npos);
  EXPECT_NE(complaint("1e999").find("not a number"), std::string::npos);
  EXPECT_NE(complaint("0x10").find("operator is expected"), std::string::npos);
  EXPECT_NE(complaint(std::string(60, 'a')).find("name longer"), std::string::npos);
  EXPECT_NE(complaint(std::string(1000, '1')).find("longer than"), std::string::npos);
  EXPECT_NE(complaint(std::string(100, '(') + "1" + std::string(100, ')')).find("deeply"), std::string::npos);
  EXPECT_NE(complaint(std::string(100, '-') + "1").find("deeply"), std::string::npos);
}

TEST(Formula, too_many_parameters_and_operations_are_refused) {
  std::string many = "p0";
  for (int k = 1; k < 20; k++) many += "+p" + std::to_string(k);
  EXPECT_NE(complaint(many).find("more than 16"), std::string::npos);
  std::string lengthy = "1";
  for (int k = 0; k < 120; k++) lengthy += "+1";
  EXPECT_NE(complaint(lengthy).find("too long"), std::string::npos);
}

// Whatever the bytes: a verdict, and a formula that was accepted evaluates to a finite number.
TEST(Formula, random_bytes_and_mutations_never_break_it) {
  std::mt19937 random(7);
  const std::string alphabet = "0123456789.eE+-*/^(),abcsinocxptmv_ \t#\xc3\xa9\x01";
  const std::string seed = "c * omega_rad_s * cos(3*theta_rad) + max(a, b/2)^2";
  int accepted = 0;
  for (int round = 0; round < 60000; round++) {
    std::string text = round % 2 ? seed : "";
    const int edits = round % 2 ? 1 + int(random() % 4) : int(random() % 40);
    for (int k = 0; k < edits; k++) {
      const char c = alphabet[random() % alphabet.size()];
      if (text.empty() || random() % 2) text.insert(text.begin() + long(random() % (text.size() + 1)), c);
      else text[random() % text.size()] = c;
    }
    driveid_formula f;
    char message[64];
    const driveid_status s = driveid_formula_parse(text.c_str(), &f, message, sizeof message);
    ASSERT_TRUE(s == DRIVEID_OK || s == DRIVEID_ERR_FORMAT);
    if (s) continue;
    accepted++;
    double p[DRIVEID_FORMULA_PARAMS_MAX], column[DRIVEID_FORMULA_PARAMS_MAX];
    for (double &v : p) v = 0.7;
    driveid_effect_state state = {};
    state.speed = 1.3;
    ASSERT_TRUE(std::isfinite(driveid_formula_value(&f, &state, p, nullptr))) << text;
    driveid_formula_columns(&f, &state, p, column);
  }
  EXPECT_GT(accepted, 1000);
}
