// SPDX-License-Identifier: Apache-2.0
// The last parameters with their covariance survive a restart, whatever the instant of a crash. One file:
//   driveid-state 1 <crc32 of the JSON, 8 hex digits> <length of the JSON>\n<JSON>
// Written to state.tmp, synced, the old one renamed to state.old, the new one renamed to state, the folder synced.
#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "drive/drive.hpp"

namespace gw {

// "" or what went wrong.
std::string state_save(const std::string& folder, const std::vector<std::unique_ptr<Drive>>& drives);

// Parameters of drives whose name, structure, method, type and parameter names are the same come back as known but not trusted,
// with their age. Returns a sentence for the log, "" where there was nothing to restore.
std::string state_restore(const std::string& folder, std::vector<std::unique_ptr<Drive>>& drives);

// The JSON inside a state file, or false where it is damaged.
bool state_open(std::string_view file, std::string_view& json);
// False where the JSON is no state. Never throws.
bool state_apply(std::string_view json, std::vector<std::unique_ptr<Drive>>& drives, int64_t now_wall_ns, int64_t now_ns, int& restored);

}  // namespace gw
