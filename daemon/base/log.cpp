// SPDX-License-Identifier: Apache-2.0
#include "base/log.hpp"

#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <unistd.h>

#include "base/clock.hpp"

namespace gw {

namespace {

constexpr int kBurst = 5;
constexpr int64_t kWindowNs = 10000000000;

struct Bucket {
    uint64_t hash;
    int64_t window_ns;
    int lines;
    uint32_t kept_back;
};

Level g_least = Level::info;
LogListener g_listener = nullptr;
void* g_context = nullptr;
Bucket g_buckets[256];

uint64_t hash_of(const char* a, const char* b) {
    uint64_t h = 1469598103934665603u;
    for (const char* p = a; *p; ++p) h = (h ^ uint8_t(*p)) * 1099511628211u;
    h = (h ^ 0x1Fu) * 1099511628211u;
    for (const char* p = b; *p; ++p) h = (h ^ uint8_t(*p)) * 1099511628211u;
    return h | 1u;
}

// Returns how many events this line stands for, 0 where it is kept back.
uint32_t admit(const char* component, const char* key, int64_t now) {
    const uint64_t hash = hash_of(component, key);
    Bucket& b = g_buckets[hash % 256];
    if (b.hash != hash || now - b.window_ns > kWindowNs) {
        const uint32_t kept = b.hash == hash ? b.kept_back : 0;
        b = {hash, now, 1, 0};
        return kept + 1;
    }
    if (b.lines < kBurst) {
        ++b.lines;
        return 1;
    }
    ++b.kept_back;
    return 0;
}

// journald's level prefix ("<4>") is used only where stderr is the journal.
const char* prefix(Level level) {
    static const bool journal = getenv("JOURNAL_STREAM") != nullptr;
    if (!journal) return "";
    switch (level) {
        case Level::debug: return "<7>";
        case Level::info: return "<6>";
        case Level::warning: return "<4>";
        default: return "<3>";
    }
}

}  // namespace

const char* level_name(Level level) {
    static const char* const names[] = {"debug", "info", "warning", "error"};
    return names[int(level)];
}

void log_level(Level least) { g_least = least; }

void log_listen(LogListener listener, void* context) {
    g_listener = listener;
    g_context = context;
}

void log_event(Level level, const char* component, const char* key, const char* mend, const char* format, ...) {
    if (level < g_least) return;
    const int64_t now = monotonic_ns();
    const uint32_t count = admit(component, key, now);
    if (count == 0) return;
    char text[512];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    for (char* p = text; *p; ++p)
        if (uint8_t(*p) < 0x20) *p = '?';  // hostile input must not forge a second line
    char line[900];
    int n = snprintf(line, sizeof line, "%slevel=%s component=%s count=%u text=\"%s\"%s%s%s\n", prefix(level), level_name(level),
                     component, count, text, *mend ? " mend=\"" : "", mend, *mend ? "\"" : "");
    if (n >= int(sizeof line)) {
        n = sizeof line - 1;
        line[n - 1] = '\n';
    }
    if (write(STDERR_FILENO, line, size_t(n)) < 0) { /* nowhere left to say it */ }
    if (g_listener) g_listener(g_context, {now, level, component, text, mend, count});
}

}  // namespace gw
