// SPDX-License-Identifier: Apache-2.0
#include "csv_frames.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "logger.hpp"

namespace sim {
namespace {

struct Table {
    std::vector<std::string> names;
    std::vector<std::vector<double>> columns;
    std::size_t find(const std::string &name, const std::string &file) const {
        for (std::size_t n = 0; n < names.size(); ++n) if (names[n] == name) return n;
        std::string all;
        for (const auto &n : names) all += " " + n;
        throw std::runtime_error(file + ": no column '" + name + "'; there are:" + all);
    }
};

Table read_csv(const std::string &file) {
    std::ifstream in(file);
    if (!in) throw std::runtime_error("cannot read " + file);
    Table out;
    std::string line, cell;
    std::getline(in, line);
    std::stringstream head(line);
    while (std::getline(head, cell, ',')) {
        cell.erase(0, cell.find_first_not_of(" \t\""));
        cell.erase(cell.find_last_not_of(" \t\r\"") + 1);
        out.names.push_back(cell);
    }
    out.columns.resize(out.names.size());
    for (std::size_t number = 2; std::getline(in, line); ++number) {
        if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
        std::stringstream row(line);
        for (std::size_t n = 0; n < out.names.size(); ++n) {
            char *end = nullptr;
            if (!std::getline(row, cell, ',')) throw std::runtime_error(file + ":" + std::to_string(number) + ": column '" + out.names[n] + "' is missing");
            const double value = std::strtod(cell.c_str(), &end);
            if (end == cell.c_str()) throw std::runtime_error(file + ":" + std::to_string(number) + ": column '" + out.names[n] + "' is no number: " + cell);
            out.columns[n].push_back(value);
        }
    }
    if (out.columns.empty() || out.columns[0].empty()) throw std::runtime_error(file + ": no rows");
    return out;
}

struct Channel { std::string signal; std::size_t column; double factor; };

Channel channel_of(const std::string &spec, const Table &table, const std::string &file) {
    const auto equal = spec.find('='), colon = spec.rfind(':');
    if (equal == std::string::npos) return {spec, table.find(spec, file), 1};
    const bool scaled = colon != std::string::npos && colon > equal;
    const std::string column = spec.substr(equal + 1, scaled ? colon - equal - 1 : std::string::npos);
    return {spec.substr(0, equal), table.find(column, file), scaled ? std::stod(spec.substr(colon + 1)) : 1};
}

}  // namespace

std::size_t csv_to_frames(const CsvFramesRequest &q) {
    const Table table = read_csv(q.csv);
    std::vector<Channel> channels;
    for (const auto &spec : q.map) channels.push_back(channel_of(spec, table, q.csv));
    if (channels.empty())
        for (const auto &name : signals_of(q.options.structure))
            if (std::find(table.names.begin(), table.names.end(), name) != table.names.end()) channels.push_back(channel_of(name, table, q.csv));
    if (channels.empty()) throw std::runtime_error(q.csv + ": no column is named as a signal of " + q.options.structure + "; give --map NAME=COLUMN");

    // Two 32-bit fields in a classic frame, up to fifteen in an FD frame; resolution as fine as the range allows.
    std::vector<FrameLayout> layout;
    const std::size_t each = q.fd ? 15 : 2;
    for (std::size_t n = 0; n < channels.size(); ++n) {
        if (n % each == 0) layout.push_back({"record_" + std::to_string(n / each), q.id + static_cast<std::uint32_t>(0x100 * (n / each)), q.fd, q.fd ? 64 : 8, {}});
        const auto &values = table.columns[channels[n].column];
        double largest = 1e-9;
        for (double v : values) largest = std::max(largest, std::fabs(v * channels[n].factor));
        Field f;
        f.signal = channels[n].signal; f.length = 32; f.big_endian = q.big_endian; f.value = &Reading::i;  // replaced for each value below
        f.scale = std::pow(10.0, std::ceil(std::log10(largest / 2147483000.0)));
        const int bit = 32 * static_cast<int>(n % each);
        f.start = q.big_endian ? bit + 7 : bit;
        const auto unit = f.signal.rfind('_');
        f.unit = unit == std::string::npos ? "" : f.signal.substr(unit + 1);
        layout.back().fields.push_back(f);
    }

    std::string name = "t_s";
    double per_second = 1;
    if (std::find(table.names.begin(), table.names.end(), name) == table.names.end()) { name = "t_ns"; per_second = 1e-9; }
    const auto &time = table.columns[table.find(name, q.csv)];
    std::string log;
    for (std::size_t row = 0; row < time.size(); ++row) {
        for (std::size_t n = 0, at = 0; n < layout.size(); ++n) {
            Frame frame;
            frame.id = layout[n].id; frame.fd = q.fd; frame.length = static_cast<std::uint8_t>(layout[n].length);
            frame.t_ns = 1700000000000000000LL + std::llround(time[row] * per_second * 1e9) + 120000LL * static_cast<std::int64_t>(n);
            for (const auto &f : layout[n].fields) {
                const auto &c = channels[at++];
                const auto raw = std::llround(table.columns[c.column][row] * c.factor / f.scale);
                set_bits(frame.data, f.start, f.length, f.big_endian, static_cast<std::uint64_t>(raw));
            }
            log += candump_line(frame, q.interface);
        }
    }
    write_text(q.log, log);
    if (!q.dbc.empty()) write_text(q.dbc, dbc_text(layout));
    if (!q.config.empty()) {
        ConfigOptions o = q.options;
        std::vector<double> steps;
        for (std::size_t n = 1; n < time.size(); ++n) steps.push_back((time[n] - time[n - 1]) * per_second);
        std::nth_element(steps.begin(), steps.begin() + static_cast<long>(steps.size() / 2), steps.end());
        o.dt_s = steps.empty() ? 0.001 : std::round(steps[steps.size() / 2] * 1e7) / 1e7;
        o.source_kind = q.replay ? "replay" : "socketcan";
        o.address = q.replay ? std::filesystem::absolute(q.log).string() : q.interface;
        o.fd = q.fd;
        write_text(q.config, config_text(layout, o));
    }
    return time.size();
}

}  // namespace sim
