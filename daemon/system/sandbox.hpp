// SPDX-License-Identifier: Apache-2.0
// What the daemon gives away once its sources are open: user, capabilities, system calls.
#pragma once
#include <string>

#include "config/config.hpp"

namespace gw {

// Each throws std::runtime_error with the mend.
void set_scheduling(const SystemConfig& config);              // mlockall, SCHED_FIFO
void drop_privileges(const std::string& user);                // "" keeps the user; capabilities go in any case
void restrict_system_calls(const std::string& mode);          // on | off | log

}  // namespace gw
