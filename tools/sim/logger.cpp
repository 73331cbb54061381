// SPDX-License-Identifier: Apache-2.0
#include "logger.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>
#include <stdexcept>

namespace sim {
namespace {

bool has(const Setup &s, const char *word) {
    return (" " + s.sensors.dirt + " ").find(std::string(" ") + word + " ") != std::string::npos;
}

struct Column { std::string name; double Reading::*value; const char *format; };

std::vector<Column> columns_of(const Setup &s) {
    const auto &d = s.drive;
    const auto &n = s.sensors;
    std::vector<Column> out;
    if (n.has_i && d.pmsm) { out.push_back({"i_d_A", &Reading::i_d, "%.7g"}); out.push_back({"i_q_A", &Reading::i, "%.7g"}); }
    else if (n.has_i) out.push_back({d.structure == "rigid_axis" && n.current_is_q ? "i_q_A" : "i_A", &Reading::i, "%.7g"});
    if (n.has_tau) out.push_back({d.linear ? "F_N" : "tau_Nm", &Reading::torque, "%.7g"});
    if (d.pmsm) { out.push_back({"v_d_V", &Reading::v_d, "%.7g"}); out.push_back({"v_q_V", &Reading::v, "%.7g"}); }
    else if (d.structure.rfind("dc_", 0) == 0) out.push_back({"v_V", &Reading::v, "%.7g"});
    if (n.has_q) out.push_back({d.linear ? "x_m" : "theta_rad", &Reading::q, "%.11g"});
    if (n.has_w) out.push_back({d.linear ? "v_m_s" : "omega_rad_s", &Reading::w, "%.8g"});
    if (n.has_T) out.push_back({"T_degC", &Reading::T, "%.4g"});
    return out;
}

void make_dirty(const Setup &s, std::vector<Reading> &rows, Random &rng) {
    const double dt = 1 / s.sensors.rate_Hz;
    if (has(s, "lag")) {
        const auto lag = static_cast<std::size_t>(rng.integer(1, 4));
        for (std::size_t n = rows.size(); n-- > 0;) rows[n].w = rows[n > lag ? n - lag : 0].w;
    }
    if (has(s, "glitch"))
        for (int n = rng.integer(3, 8); n > 0; --n) {
            auto &row = rows[static_cast<std::size_t>(rng.uniform() * static_cast<double>(rows.size()))];
            if (s.sensors.has_q && rng.chance(0.5)) row.q += rng.sign() * 0.05 * s.drive.range;
            else { const double bad = rng.sign() * 6 * s.drive.I_rated; row.i = bad; row.torque = bad * s.drive.K_t; }
        }
    if (has(s, "wrap")) for (auto &row : rows) row.q -= 2 * M_PI * std::floor(row.q / (2 * M_PI));
    if (has(s, "jitter")) for (auto &row : rows) row.t += 0.08 * dt * rng.normal();
    if (has(s, "dropped")) {
        const double share = rng.uniform(0.002, 0.01), gap_s = rng.uniform(0.1, 0.4), end = rows.back().t;
        const double at = rng.uniform(0.2, 0.8) * end;
        rows.erase(std::remove_if(rows.begin(), rows.end(), [&](const Reading &r) {
            return rng.chance(share) || (r.t > at && r.t < at + gap_s); }), rows.end());
    }
}

}  // namespace

void write_text(const std::string &file, const std::string &text) {
    std::unique_ptr<std::FILE, int (*)(std::FILE *)> out(std::fopen(file.c_str(), "w"), &std::fclose);
    if (!out || std::fwrite(text.data(), 1, text.size(), out.get()) != text.size() || std::fflush(out.get()) != 0)
        throw std::runtime_error("cannot write " + file + ": " + std::strerror(errno));
}

void write_record(const Setup &setup, const std::vector<Reading> &readings, std::uint64_t record, const std::string &file) {
    std::vector<Reading> rows = readings;
    Random rng(setup.seed * 31 + record, "dirt");
    make_dirty(setup, rows, rng);
    const auto columns = columns_of(setup);
    std::string text = "t_s";
    for (const auto &c : columns) text += "," + c.name;
    text += "\n";
    char number[40];
    for (const auto &row : rows) {
        std::snprintf(number, sizeof number, "%.7f", row.t);
        text += number;
        for (const auto &c : columns) { text += ','; std::snprintf(number, sizeof number, c.format, row.*c.value); text += number; }
        text += '\n';
    }
    write_text(file, text);
}

std::map<std::string, double> given_parameters(const Setup &s) {
    std::map<std::string, double> out;
    const auto &d = s.drive;
    Random rng(s.seed, "given");
    double K_t = d.K_t;
    if (has(s, "k_t")) K_t *= 1 + rng.sign() * rng.uniform(0.015, 0.05);
    const bool unknown = rng.chance(0.2) && d.structure == "rigid_axis" && !has(s, "k_t");  // per ampere then
    if (d.structure == "rigid_axis" && s.sensors.has_i && !unknown) out["K_t_Nm_A"] = K_t;
    if (d.structure == "dc_drive") out["K_t_Nm_A"] = K_t;
    if (d.linear && s.sensors.has_i) out["K_F_N_A"] = K_t;
    if (d.pmsm) out["pole_pairs"] = d.pole_pairs;
    return out;
}

}  // namespace sim
