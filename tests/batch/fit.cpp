// SPDX-License-Identifier: Apache-2.0
// Fit through the public function: truth recovered, intervals that cover, refusals that say what to record.
#include <cstdlib>
#include <cstring>

#include <gtest/gtest.h>

#include "fitted.hpp"

TEST(Fit, two_records_and_a_gap_are_one_fit) {
  records::Drive d;
  std::vector<records::Record> training{records::closed_loop(d, 8, 2e-3, 5), records::closed_loop(d, 8, 2e-3, 6)};
  for (auto &v : training[0].column) v.second.erase(v.second.begin() + 2000, v.second.begin() + 2400);
  training[0].t.erase(training[0].t.begin() + 2000, training[0].t.begin() + 2400);
  const json j = fit(kModel, training);
  EXPECT_NEAR(j["parameters"]["J_kgm2"]["value"].get<double>(), d.J, 0.01 * d.J);
  EXPECT_NEAR(j["parameters"]["tau_c_Nm"]["value"].get<double>(), d.tau_c, 0.02 * d.tau_c);
  EXPECT_EQ(j["records"].size(), 2u);
  EXPECT_TRUE(j["model_toml"].get<std::string>().find("[[history]]") != std::string::npos);
}

TEST(Fit, without_torque_constant_parameters_are_per_ampere) {
  records::Drive d;
  std::vector<records::Record> training{records::closed_loop(d, 10, 2e-3, 7)};
  const json j = fit("format = 1\nstructure = \"rigid_axis\"\n[[effect]]\nname = \"coulomb\"\n[[effect]]\nname = \"constant_load\"\n", training);
  EXPECT_NEAR(j["parameters"]["J_As2_rad"]["value"].get<double>(), d.J / d.K_t, 0.01 * d.J / d.K_t);
  EXPECT_NEAR(j["parameters"]["tau_c_A"]["value"].get<double>(), d.tau_c / d.K_t, 0.02 * d.tau_c / d.K_t);
}

TEST(Fit, cogging_of_unknown_order_and_an_own_formula) {
  records::Drive d;
  d.cogging = 0.006;
  std::vector<records::Record> training{records::closed_loop(d, 12, 2e-3, 8)};
  const json a = fit(std::string(kModel) + "[[effect]]\nname = \"cogging\"\n", training);
  EXPECT_NEAR(a["parameters"]["N"]["value"].get<double>(), 7, 1e-6);
  EXPECT_NEAR(a["parameters"]["A_Nm"]["value"].get<double>(), 0.006, 3e-4);
  const json b = fit(std::string(kModel) + "[[effect]]\nname = \"mine\"\nformula = \"c*sin(7*theta_rad)\"\nadds_to = \"tau_Nm\"\n", training);
  EXPECT_NEAR(b["parameters"]["c"]["value"].get<double>(), 0.006, 3e-4);
}

TEST(Fit, given_values_stay) {
  records::Drive d;
  std::vector<records::Record> training{records::closed_loop(d, 8, 2e-3, 9)};
  const json j = fit(std::string(kModel) + "[parameters.J_kgm2]\nvalue = 1.2e-4\nstate = \"given\"\n", training);
  EXPECT_EQ(j["parameters"]["J_kgm2"]["value"].get<double>(), 1.2e-4);
  EXPECT_EQ(j["parameters"]["J_kgm2"]["state"], "given");
}

TEST(Fit, refusals_say_what_to_record) {
  std::string said;
  std::vector<records::Record> training{records::closed_loop({}, 8, 2e-3, 10)};
  training[0].column.erase("i_A");
  json j = fit(kModel, training, DRIVEID_ERR_DATA, &said);
  EXPECT_EQ(j["verdict"], "bad_data");
  EXPECT_NE(said.find("record"), std::string::npos);
  training = {records::closed_loop({}, 0.05, 2e-3, 10)};
  j = fit(kModel, training, DRIVEID_ERR_DATA, &said);
  EXPECT_NE(said.find("record"), std::string::npos);
  training = {records::closed_loop({}, 8, 2e-3, 10)};
  std::fill(training[0].column["theta_rad"].begin(), training[0].column["theta_rad"].end(), 1.0);
  fit(kModel, training, DRIVEID_ERR_DATA, &said);
  EXPECT_NE(said.find("does not move"), std::string::npos) << said;
  training = {records::closed_loop({}, 8, 2e-3, 10)};
  for (double &v : training[0].column["i_A"]) v = -v;
  fit(kModel, training, DRIVEID_ERR_DATA, &said);
  EXPECT_NE(said.find("sign"), std::string::npos) << said;
}

TEST(Fit, bad_arguments_are_refused_without_a_document) {
  driveid_task task = {};
  char *text = nullptr, message[100];
  EXPECT_EQ(driveid_fit(&task, &text, message, sizeof message), DRIVEID_ERR_ARGUMENT);
  EXPECT_EQ(driveid_fit(nullptr, &text, message, sizeof message), DRIVEID_ERR_ARGUMENT);
  std::vector<records::Record> training{records::closed_loop({}, 2, 2e-3, 10)};
  fit("format = 1\nstructure = \"nonsense\"", training, DRIVEID_ERR_FORMAT);
}

TEST(Fit, a_progress_that_says_stop_is_obeyed) {
  records::Record r = records::closed_loop({}, 8, 2e-3, 11);
  const driveid_record raw = r.get();
  driveid_task task = {kModel, &raw, 1, nullptr, 0, nullptr, [](void *, double, const char *) { return 1; }, nullptr};
  char *text = nullptr, message[100];
  EXPECT_EQ(driveid_fit(&task, &text, message, sizeof message), DRIVEID_NOT_YET);
  EXPECT_EQ(text, nullptr);
}

TEST(Compare, errors_tests_and_the_free_run) {
  records::Drive d;
  std::vector<records::Record> training{records::closed_loop(d, 10, 2e-3, 12)};
  const std::string good = fit(kModel, training)["model_toml"].get<std::string>();
  const std::string poor = fit("format = 1\nstructure = \"rigid_axis\"\n[parameters.K_t_Nm_A]\nvalue = 0.05\nstate = \"given\"\n", training)["model_toml"].get<std::string>();
  auto compare = [&](const std::string &model) {
    std::vector<driveid_record> raw{training[0].get()};
    driveid_task task = {model.c_str(), raw.data(), 1, nullptr, 0, nullptr, nullptr, nullptr};
    char *text = nullptr, message[300] = "";
    EXPECT_EQ(driveid_compare(&task, &text, message, sizeof message), DRIVEID_OK) << message;
    const json document = json::parse(text);
    driveid_text_free(text);
    return document;
  };
  const json a = compare(good), b = compare(poor);
  for (const char *key : {"equation", "one_step", "windows", "free_run"}) {
    const json &e = a["records"][0][key];
    EXPECT_GT(e["rmse"].get<double>(), 0) << key;
    EXPECT_LE(e["noise_floor"][0].get<double>(), e["noise_floor"][1].get<double>()) << key;
    EXPECT_LT(e["rmse"].get<double>(), b["records"][0][key]["rmse"].get<double>()) << key;
  }
  EXPECT_EQ(a["free_run_rmse"], a["records"][0]["free_run"]["rmse"]);
  auto test = [](const json &document, const std::string &name) {
    for (const json &t : document["records"][0]["tests"])
      if (t["name"] == name) return t;
    ADD_FAILURE() << "no test " << name;
    return json();
  };
  const std::string sign = "independence of sign(omega)";
  EXPECT_FALSE(test(b, sign)["passed"].get<bool>());
  EXPECT_LT(test(a, sign)["statistic"].get<double>(), 0.3 * test(b, sign)["statistic"].get<double>());   // with the friction in the model
}

// Against values that the model brings along a swapped sign and a wrong unit show as a factor.
TEST(Compare, swapped_signs_and_wrong_units_are_said) {
  records::Drive d;
  std::vector<records::Record> training{records::closed_loop(d, 8, 2e-3, 12)};
  const std::string model = fit(kModel, training)["model_toml"].get<std::string>();
  auto said = [&](double factor, const char *column) {
    records::Record r = records::closed_loop(d, 8, 2e-3, 13);
    for (double &v : r.column[column]) v *= factor;
    const driveid_record raw = r.get();
    driveid_task task = {model.c_str(), &raw, 1, nullptr, 0, nullptr, nullptr, nullptr};
    char *text = nullptr, message[300] = "";
    EXPECT_EQ(driveid_compare(&task, &text, message, sizeof message), DRIVEID_OK) << message;
    std::string kinds;
    const json document = json::parse(text);
    for (const json &n : document["notices"]) kinds += n["kind"].get<std::string>() + ": " + n["text"].get<std::string>() + "\n";
    driveid_text_free(text);
    return kinds;
  };
  EXPECT_EQ(said(1, "i_A").find("units:"), std::string::npos);
  EXPECT_EQ(said(1, "i_A").find("sign:"), std::string::npos);
  EXPECT_NE(said(-1, "i_A").find("sign:"), std::string::npos);
  EXPECT_NE(said(1000, "i_A").find("thousandths"), std::string::npos);
  EXPECT_NE(said(57.29578, "theta_rad").find("degrees"), std::string::npos);
}

// One of two records with its current reversed: the pair is no average of both, it is refused by name. Explain refuses it too.
TEST(Fit, a_record_with_a_swapped_sign_is_named) {
  records::Drive d;
  std::vector<records::Record> training{records::closed_loop(d, 8, 2e-3, 5), records::closed_loop(d, 8, 2e-3, 6)};
  training[1].name = "second";
  for (double &v : training[1].column["i_A"]) v = -v;
  std::string said;
  fit(kModel, training, DRIVEID_ERR_DATA, &said);
  EXPECT_NE(said.find("second: input and motion have opposite signs"), std::string::npos) << said;
  const driveid_record raw[] = {training[0].get(), training[1].get()};
  driveid_task task = {kModel, raw, 2, nullptr, 0, nullptr, nullptr, nullptr};
  char *text = nullptr, message[300] = "";
  EXPECT_EQ(driveid_explain(&task, &text, message, sizeof message), DRIVEID_ERR_DATA);
  EXPECT_NE(std::string(message).find("opposite signs"), std::string::npos) << message;
  driveid_text_free(text);
}

TEST(Series, rows_and_names_are_those_of_the_record) {
  records::Record r = records::closed_loop({}, 6, 2e-3, 13);
  std::vector<records::Record> training{r};
  const std::string model = fit(kModel, training)["model_toml"].get<std::string>();
  const driveid_record raw = r.get();
  char *text = nullptr, message[300] = "";
  double *data = nullptr;
  ASSERT_EQ(driveid_series(model.c_str(), &raw, &text, &data, message, sizeof message), DRIVEID_OK) << message;
  const json header = json::parse(text);
  ASSERT_EQ(header["rows"].get<size_t>(), raw.rows);
  std::map<std::string, size_t> at;
  for (size_t k = 0; k < header["series"].size(); k++) at[header["series"][k]["name"]] = k;
  ASSERT_TRUE(at.count("theta_rad") && at.count("theta_rad.free_run") && at.count("theta_rad.one_step") && at.count("torque.equation"));
  EXPECT_EQ(data[at["theta_rad"] * raw.rows + 100], r.column["theta_rad"][100]);
  EXPECT_NEAR(data[at["theta_rad.one_step"] * raw.rows + 100], r.column["theta_rad"][100], 1e-3);
  driveid_series_free(data);
  driveid_text_free(text);
}
