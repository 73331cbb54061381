// SPDX-License-Identifier: Apache-2.0
// What every command does around its work: read the task, refuse what cannot be answered, write the document.
#pragma once

#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include <driveid/diagnose.h>

#include "diagnose/record.hpp"

namespace driveid::diagnose {

struct Task {
  driveid_model model;
  std::string history;
  std::vector<Prepared> training, held_out;
  nlohmann::json options = nlohmann::json::object();
  int threads = 2;
  std::function<bool(double, const char *)> tick;   // false: cancelled
};

// Thrown by the work of a command; the frame around it turns it into status, message and document.
struct BadData : std::runtime_error { using std::runtime_error::runtime_error; };
struct Cancelled {};

// Reads the task, runs work, writes its document with the common head ("format", "driveid", "model", "records", "notices").
// Bad data: the document has verdict "bad_data" and the status is DRIVEID_ERR_DATA.
driveid_status answer(const driveid_task *task, char **json, char *message, size_t message_size,
                      const std::function<void(Task &, nlohmann::ordered_json &document)> &work);

nlohmann::ordered_json parameters_json(const driveid_model &model);
nlohmann::ordered_json notices_json(const std::vector<Notice> &notices);
std::string model_text(const driveid_model &model, const std::string &history);
std::string number_text(double value);

}  // namespace driveid::diagnose
