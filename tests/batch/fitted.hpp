// SPDX-License-Identifier: Apache-2.0
// driveid_fit on records made here, as a JSON document; and the axis that most of them are fitted with.
#pragma once

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "records.hpp"

using nlohmann::json;

inline const char *const kModel =
    "format = 1\nstructure = \"rigid_axis\"\n[parameters.K_t_Nm_A]\nvalue = 0.05\nstate = \"given\"\n[[effect]]\nname = \"coulomb\"\n[[effect]]\nname = \"constant_load\"\n";

inline json fit(const std::string &model, std::vector<records::Record> &training, driveid_status expected = DRIVEID_OK, std::string *said = nullptr) {
  std::vector<driveid_record> raw;
  for (auto &r : training) raw.push_back(r.get());
  driveid_task task = {model.c_str(), raw.data(), raw.size(), nullptr, 0, nullptr, nullptr, nullptr};
  char *text = nullptr, message[600] = "";
  const driveid_status s = driveid_fit(&task, &text, message, sizeof message);
  EXPECT_EQ(s, expected) << message;
  if (said) *said = message;
  const json document = text ? json::parse(text) : json();
  driveid_text_free(text);
  return document;
}
