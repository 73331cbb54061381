// SPDX-License-Identifier: Apache-2.0
// Records as a drive's logger writes them, with the dirt that real logs have.
#pragma once
#include <map>
#include <string>
#include <vector>

#include "run.hpp"

namespace sim {

// CSV with columns named by symbol and unit. The dirt of sensors.dirt is drawn from the setup's seed and the record's number.
void write_record(const Setup &setup, const std::vector<Reading> &readings, std::uint64_t record, const std::string &file);

// What the user knows about this drive: K_t (a little wrong where the dirt says so), pole pairs.
std::map<std::string, double> given_parameters(const Setup &setup);

void write_text(const std::string &file, const std::string &text);  // throws std::runtime_error naming the file

}  // namespace sim
