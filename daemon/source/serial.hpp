// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>

#include "base/loop.hpp"

namespace gw {

// Opens a serial device raw, 8N1, non-blocking, exclusively. Empty Fd with a sentence in error where it cannot.
Fd open_serial(const std::string& device, long baud, std::string& error);

}  // namespace gw
