// SPDX-License-Identifier: Apache-2.0
// One table of keys: it drives parsing, validation, defaults, the manual page and the canonical text.
#pragma once
#include <limits>
#include <span>
#include <string>
#include <variant>

#include "config/config.hpp"

namespace gw {

template <class S>
struct Key {
    const char* name;
    std::variant<bool S::*, int64_t S::*, double S::*, std::string S::*> member;
    const char* unit;        // "" where none
    double lo, hi;           // numbers: allowed range
    const char* fallback;    // default as text; nullptr: required
    const char* choices;     // strings: "a|b|c", "" free
    const char* help;
    const char* only_kind;   // "" always, else the kinds it belongs to "a|b": refused for others
};

inline constexpr double kAny = std::numeric_limits<double>::infinity();

std::span<const Key<Config>> top_keys();
std::span<const Key<ControlConfig>> control_keys();
std::span<const Key<RecordConfig>> record_keys();
std::span<const Key<StateConfig>> state_keys();
std::span<const Key<SecurityConfig>> security_keys();
std::span<const Key<SystemConfig>> system_keys();
std::span<const Key<SourceConfig>> source_keys();
std::span<const Key<DriveConfig>> drive_keys();
std::span<const Key<FieldConfig>> field_keys();
std::span<const Key<FieldConfig>> mux_keys();
std::span<const Key<SignalConfig>> signal_keys();
std::span<const Key<SinkConfig>> sink_keys();

}  // namespace gw
