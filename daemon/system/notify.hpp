// SPDX-License-Identifier: Apache-2.0
// sd_notify without libsystemd.
#pragma once
#include <cstdint>

namespace gw {

void notify(const char* message);            // "READY=1", "WATCHDOG=1", "STOPPING=1", "RELOADING=1"; nothing where nobody listens
int64_t watchdog_period_ns();                // half of WATCHDOG_USEC, 0 where there is no watchdog

}  // namespace gw
