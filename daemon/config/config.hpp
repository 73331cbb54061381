// SPDX-License-Identifier: Apache-2.0
// The configuration as plain data. keys.cpp says what each key means; nothing else knows its name, unit, range or default.
#pragma once
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace gw {

struct Place { int line = 0; };  // where a table begins, for messages that concern it as a whole

struct ControlConfig {
    Place place;
    std::string socket, mode, group, write_group;
    int64_t clients, queue_bytes;
};

struct RecordConfig {
    Place place;
    std::string folder, file;
    int64_t max_bytes, buffer_bytes;
};

struct StateConfig {
    Place place;
    std::string folder;
    double period_s;
};

struct SecurityConfig {
    Place place;
    std::string user, seccomp;
};

struct SystemConfig {
    Place place;
    std::string log_level, metrics;
    int64_t realtime_priority;
    bool lock_memory;
};

struct SourceConfig {
    Place place;
    std::string name, kind;
    std::string interface;                                   // socketcan
    bool fd;
    int64_t buffer_bytes;
    int64_t descriptor;                                      // socketpair
    std::string device, parity;                              // slcan, modbus_rtu
    int64_t baud, bitrate;
    bool rs485;
    std::string host;                                        // modbus_tcp
    int64_t port, unit, merge_gap;
    double poll_s, timeout_s;
    std::string file, recorded_source;                       // replay
    double speed;
};

struct FieldConfig {  // where a number stands in a message, and how it becomes SI
    Place place;
    std::string source;
    int64_t can_id;
    bool extended;
    int64_t pgn;
    int64_t start_bit, length;
    std::string byte_order, encoding;
    bool is_signed;
    int64_t mux_start_bit, mux_length, mux_value;
    int64_t address, registers;                              // Modbus
    std::string table, word_order;
    double scale, offset;
    double counts_per_turn, gear_ratio;
    int64_t wrap_counts;
    double min, max, max_rate;
};

struct SignalConfig : FieldConfig {
    std::string name, hold;
    bool wait;
    double delay_s, range;
};

struct DriveConfig {
    Place place;
    std::string name, model, structure, method, type, sync;
    std::vector<std::pair<std::string, double>> given;
    std::vector<std::string> effects;
    bool paced;
    double count_s;
    bool watch;
    double dt_s, bandwidth_rad_s, motion_rad_s, forgetting_s, gap_s, align_tolerance_s, skew_s, report_s, stale_s, alarm, speed_range, highest_Hz;
    int64_t sinusoids;
    int64_t instant_can_id;
    bool record_samples;
    std::vector<SignalConfig> signals;
    bool has_counter = false;
    FieldConfig counter;
};

struct SinkConfig {
    Place place;
    std::string name, kind;
    std::string source, drive;                               // can
    int64_t can_id;
    bool extended;
    double period_s;
    std::string host;                                        // modbus_server
    int64_t port, unit, address, clients;
    std::string file;                                        // record
};

struct Config {
    std::string file, folder, text;                          // path as given, its folder, the whole text
    int64_t format;
    ControlConfig control;
    RecordConfig record;
    StateConfig state;
    SecurityConfig security;
    SystemConfig system;
    std::vector<SourceConfig> sources;
    std::vector<DriveConfig> drives;
    std::vector<SinkConfig> sinks;
};

// All problems found, one a line: "file:line: key: what is wrong; mend". ok where empty.
struct ConfigResult {
    Config config;
    std::vector<std::string> errors;
};

ConfigResult config_read_file(const std::string& path);
ConfigResult config_read_text(const std::string& text, const std::string& path);

// What the table of keys says, as Markdown (docs/manual/configuration.md).
std::string config_manual();

// Cross-checks that need the whole configuration (names that must exist, collisions of identifiers). Appends to errors.
void config_check(ConfigResult& result);

// A canonical text of one item: equal where nothing of it changed (reload keeps it then).
std::string config_text(const SourceConfig& source);
std::string config_text(const DriveConfig& drive);
std::string config_text(const SinkConfig& sink);

// Absolute, or beside the configuration file.
std::string config_path(const Config& config, const std::string& path);

}  // namespace gw
