// SPDX-License-Identifier: Apache-2.0
#include "case.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>

#include "effects.hpp"
#include "logger.hpp"

namespace sim {
namespace {

using json = nlohmann::ordered_json;

const std::set<std::string> NEEDS_ANGLE = {"gravity_unbalance", "cogging", "torque_ripple", "eccentric_friction", "encoder_eccentricity",
    "hysteresis", "lugre", "backlash", "compliance", "cubic_spring", "position_inertia", "warm_spot_friction", "gear_mesh", "end_stop", "parametric_belt"};
const std::set<std::string> DRY = {"coulomb", "stribeck", "lugre", "hysteresis", "load_dependent_friction", "dead_zone"};
const std::set<std::string> SOFT = {"backlash", "compliance", "parametric_belt", "delay"};
const std::set<std::string> OPEN_LOOP = {"none", "quadratic_drag", "torque_ripple", "inertia_change", "torque_saturation", "eddy_brake"};

bool any_in(const std::vector<std::string> &names, const std::set<std::string> &set) {
    return std::any_of(names.begin(), names.end(), [&](const auto &n) { return set.count(n) > 0; });
}

Drive draw_rotary(const std::string &structure, Random &rng) {
    Drive d;
    d.structure = structure;
    d.J = rng.log_uniform(3e-6, 2e-2);                                  // hobby servo to machine axis
    d.w_max = 250 * std::pow(d.J / 1e-5, -0.12) * rng.log_uniform(0.6, 1.6);
    d.a_max = d.w_max * rng.log_uniform(6, 25);                         // 40 to 160 ms to full speed
    d.T_rated = d.J * d.a_max * rng.uniform(1.0, 1.5);
    d.I_rated = rng.log_uniform(0.5, 20);
    d.K_t = d.T_rated / d.I_rated;
    d.B = rng.uniform(0.04, 0.2) * d.T_rated / d.w_max;
    d.range = d.w_max * rng.uniform(0.3, 1.0);
    static const double counts[] = {4096, 8192, 10000, 16384, 65536, 131072, 1048576};
    d.counts = counts[rng.integer(0, 6)];
    return d;
}

Drive draw_linear(Random &rng) {
    Drive d;
    d.structure = "linear_axis"; d.linear = true;
    d.J = rng.log_uniform(1, 300);                                      // kg
    d.w_max = rng.log_uniform(0.2, 2.0);                                // m/s
    d.a_max = d.w_max * rng.log_uniform(5, 15);
    d.T_rated = d.J * d.a_max * rng.uniform(1.0, 1.5);                  // N
    d.I_rated = rng.log_uniform(1, 20);
    d.K_t = d.T_rated / d.I_rated;
    d.B = rng.uniform(0.05, 0.25) * d.T_rated / d.w_max;
    d.range = d.w_max * rng.uniform(0.3, 1.0);
    d.counts = rng.log_uniform(2e5, 4e6);                               // 5 to 0.25 micrometres
    return d;
}

void draw_circuit(Drive &d, Random &rng) {
    d.pmsm = d.structure == "pmsm_drive";
    d.pole_pairs = rng.integer(2, 5);
    d.psi = d.K_t / (1.5 * d.pole_pairs);
    d.K_e = d.pmsm ? d.pole_pairs * d.psi : d.K_t;
    d.R = rng.uniform(0.04, 0.15) * d.K_e * d.w_max / d.I_rated;
    d.L = d.R * rng.log_uniform(6e-4, 3e-3);
    d.L_d = d.L; d.L_q = d.L * rng.uniform(1.0, 1.6);
    d.V_bus = 1.4 * (d.K_e * d.w_max + 2.5 * d.R * d.I_rated);
    d.loop_current_w = rng.uniform(1000, 2000);
    d.feed_forward = rng.uniform(0.3, 1.0);
}

void draw_sensors(const CaseRequest &q, Setup &s, Random &rng) {
    auto &n = s.sensors;
    const auto &d = s.drive;
    static const double rates[] = {500, 1000, 1000, 1000, 1000, 2000, 250, 4000};
    const double rate = rates[rng.integer(0, 7)];
    n.rate_Hz = q.rate_Hz > 0 ? q.rate_Hz : rate;
    n.phase = rng.integer(0, Control::speed_ticks - 1);
    n.sigma_i = d.I_rated * rng.log_uniform(0.004, 0.025);
    n.colour_i = rng.chance(0.3) ? rng.uniform(0.4, 0.9) : 0;
    n.sigma_q = (d.linear ? 1.0 : 2 * M_PI) / d.counts * rng.uniform(0.1, 0.6);
    n.sigma_w = d.w_max * rng.log_uniform(5e-5, 8e-4);
    n.sigma_v = d.V_bus * rng.log_uniform(2e-4, 2e-3);
    n.average = rng.chance(0.3);
    const double columns = rng.uniform(), input = rng.uniform();
    const bool angle = any_in(q.effects, NEEDS_ANGLE);
    n.has_q = angle || columns < 0.8;
    n.has_w = !n.has_q || columns > 0.45;
    n.tacho = rng.chance(0.7);
    n.has_T = any_in(q.effects, {"resistance_drift", "friction_drift", "warm_spot_friction"}) && rng.chance(0.5);
    const bool current_matters = any_in(q.effects, {"torque_saturation", "torque_ripple", "current_offset", "dead_zone"});
    n.has_tau = (d.structure == "rigid_axis" && input < 0.2 && !current_matters) || (d.linear && input < 0.5);
    n.has_i = !n.has_tau;
    n.current_is_q = rng.chance(0.5);
}

std::string draw_dirt(const Setup &s, Random &rng) {
    std::vector<std::string> all{"dropped", "jitter", "glitch"};
    if (s.sensors.has_w && s.sensors.has_q) all.push_back("lag");
    if (s.sensors.has_q && !s.drive.linear) all.push_back("wrap");
    if (s.sensors.has_i) all.push_back("k_t");
    std::string out;
    const int count = rng.chance(0.35) ? 0 : rng.integer(1, 2);
    for (int n = 0; n < count; ++n) {
        const auto &word = all[static_cast<std::size_t>(rng.integer(0, static_cast<int>(all.size()) - 1))];
        if (out.find(word) == std::string::npos) out += (out.empty() ? "" : " ") + word;
    }
    return out;
}

json drive_object(const Drive &d) {
    json out = {{"structure", d.structure}};
    if (d.linear) out.update(json{{"m_kg", d.J}, {"b_Ns_m", d.B}, {"K_F_N_A", d.K_t}});
    else out.update(json{{"J_kgm2", d.J}, {"B_Nms_rad", d.B}, {"K_t_Nm_A", d.K_t}});
    out["R_ohm"] = d.R;
    if (d.pmsm) out.update(json{{"L_d_H", d.L_d}, {"L_q_H", d.L_q}, {"psi_pm_Vs", d.psi}, {"pole_pairs", d.pole_pairs}});
    else out.update(json{{"L_H", d.L}, {"K_e_Vs_rad", d.K_e}});
    if (d.coulomb > 0) out[d.linear ? "F_c_N" : "tau_c_Nm"] = d.coulomb;
    out["rated"] = {{"current_A", d.I_rated}, {"torque", d.T_rated}, {"speed", d.w_max}};
    return out;
}

json effect_objects(const Setup &s, const std::vector<std::string> &effects) {
    json out = json::array();
    for (const auto &name : effects) {
        if (name == "none") continue;
        json parameters = json::array();
        for (const auto &p : effect_parameters(name, s.drive, s.hidden)) parameters.push_back({{"name", p.name}, {"value", p.value}, {"torque", p.torque}});
        out.push_back({{"effect", name}, {"catalogue", find_effect(name)->catalogue}, {"parameters", parameters}});
    }
    return out;
}

json balance_object(const Balance &b) {
    return {{"floor", b.floor}, {"structural", b.structural}, {"ratio", b.ratio()}, {"ratio_measured", b.measured}, {"significance", b.significance}};
}

}  // namespace

Setup draw_setup(const CaseRequest &q) {
    Random rng(q.seed, "drive " + q.structure);
    Setup s;
    s.seed = q.seed;
    s.drive = q.structure == "linear_axis" ? draw_linear(rng) : draw_rotary(q.structure, rng);
    draw_circuit(s.drive, rng);
    const double friction = rng.uniform(0.04, 0.15) * s.drive.T_rated;
    const bool knows = q.known_coulomb || (q.draw_known_coulomb && rng.chance(0.35) && !any_in(q.effects, DRY) && q.structure != "dc_circuit");
    if (knows) s.drive.coulomb = friction;
    Random sensors(q.seed, "sensors of " + q.structure);
    draw_sensors(q, s, sensors);
    s.drive.loop_w = any_in(q.effects, SOFT) ? rng.uniform(25, 45) : rng.uniform(40, 140);
    s.open_loop = !s.drive.linear && rng.chance(0.12) && s.drive.coulomb == 0 &&
                  std::all_of(q.effects.begin(), q.effects.end(), [](const auto &e) { return OPEN_LOOP.count(e) > 0; });
    s.sensors.dirt = q.dirt == "auto" ? draw_dirt(s, sensors) : q.dirt == "none" ? "" : q.dirt;
    return s;
}

std::string drive_json(const Setup &s, const std::vector<std::string> &effects) {
    json out = {{"seed", s.seed}, {"drive", drive_object(s.drive)}, {"effects", effect_objects(s, effects)}};
    return out.dump(2);
}

void write_case(const CaseRequest &q, const std::string &folder, const std::string &truth_file) {
    Setup s = draw_setup(q);
    for (const auto &name : q.effects) {
        const auto *entry = find_effect(name);
        if (name != "none" && !entry) throw std::invalid_argument("unknown effect '" + name + "': `driveid-sim effects` lists them");
        if (entry && std::string(" ").append(entry->structures).append(" ").find(" " + q.structure + " ") == std::string::npos)
            throw std::invalid_argument("effect '" + name + "' cannot be hidden in " + q.structure + "; it goes with: " + entry->structures);
    }
    std::vector<double> sizes;
    json balances = json::array();
    for (const auto &name : q.effects) {
        if (name == "none") continue;
        const Calibration found = q.raw_size >= 0 ? Calibration{q.raw_size, {}} : calibrate(s, name, q.ratio, q.train_s, Hidden{});
        sizes.push_back(found.size);
    }
    s.hidden = Hidden{};
    for (std::size_t n = 0, k = 0; n < q.effects.size(); ++n)
        if (q.effects[n] != "none") add_effect(q.effects[n], sizes[k++], s.drive, q.train_s, s.seed, s.hidden);

    const auto *first = q.effects.empty() ? nullptr : find_effect(q.effects[0]);
    const bool electrical = q.structure == "dc_circuit" || (first && first->electrical);
    const char *names[] = {"train", "held_out"};
    const double length[] = {q.train_s, q.held_out_s};
    for (std::uint64_t record = 0; record < 2; ++record) {
        std::vector<Reading> readings;
        const auto truth = simulate(s, record, length[record], &readings);
        balances.push_back(balance_object(weigh(s, truth, readings, electrical)));
        write_record(s, readings, record, folder + "/" + names[record] + ".csv");
    }

    json known = {{"structure", q.structure}, {"given", json::object()}, {"effects_known", json::array()}};
    known["given"] = given_parameters(s);
    if (s.drive.coulomb > 0) known["effects_known"].push_back("coulomb");
    write_text(folder + "/case.json", known.dump(2) + "\n");

    json truth = {{"seed", q.seed}, {"ratio_wanted", q.ratio}, {"drive", drive_object(s.drive)}, {"effects", effect_objects(s, q.effects)},
                  {"sizes", sizes}, {"equation", electrical ? "electrical" : "mechanical"}, {"train", balances[0]}, {"held_out", balances[1]},
                  {"dirt", s.sensors.dirt}, {"average", s.sensors.average}, {"rate_Hz", s.sensors.rate_Hz}, {"open_loop", s.open_loop},
                  {"noise_factor", s.noise}, {"encoder_counts", s.drive.counts}};
    write_text(truth_file, truth.dump(2) + "\n");
}

}  // namespace sim
