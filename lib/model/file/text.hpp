// SPDX-License-Identifier: Apache-2.0
// Texts that cross the C boundary: allocated here, freed by driveid_text_free().
#pragma once

#include <cstring>
#include <string>

namespace driveid {

inline char *text_copy(const std::string &text) {
  char *copy = new char[text.size() + 1];
  std::memcpy(copy, text.c_str(), text.size() + 1);
  return copy;
}

}  // namespace driveid
