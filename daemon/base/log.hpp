// SPDX-License-Identifier: Apache-2.0
// Structured, rate-limited log. One line an event: level, component, text, mend. Main thread only.
#pragma once
#include <cstdint>

namespace gw {

enum class Level { debug, info, warning, error };
const char* level_name(Level level);

struct LogEvent {
    int64_t t_ns;
    Level level;
    const char* component;
    const char* text;
    const char* mend;     // "" where nothing is to be mended
    uint32_t count;       // 1 + equal events suppressed since the last line
};

// Called for each line that passes the rate limit (control socket, record).
using LogListener = void (*)(void* context, const LogEvent&);

void log_level(Level least);
void log_listen(LogListener listener, void* context);

// At most 5 lines in 10 s per (component, key); the next one tells how many were kept back. key is a string literal.
void log_event(Level level, const char* component, const char* key, const char* mend, const char* format, ...)
    __attribute__((format(printf, 5, 6)));

}  // namespace gw
