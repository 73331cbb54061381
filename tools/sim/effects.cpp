// SPDX-License-Identifier: Apache-2.0
#include "effects.hpp"

#include <cmath>
#include <functional>
#include <map>
#include <stdexcept>

#include "random.hpp"

namespace sim {
namespace {

constexpr const char *MECHANICAL = "rigid_axis linear_axis dc_drive pmsm_drive";
constexpr const char *ROTARY = "rigid_axis dc_drive pmsm_drive";
constexpr const char *ELECTRICAL = "dc_circuit dc_drive pmsm_drive";

const std::vector<EffectEntry> TABLE = {
    {"coulomb", true, MECHANICAL, 4, false},
    {"stribeck", true, MECHANICAL, 4, false},
    {"lugre", true, MECHANICAL, 4, false},
    {"asymmetric_friction", true, MECHANICAL, 4, false},
    {"load_dependent_friction", true, MECHANICAL, 4, false},
    {"quadratic_drag", true, MECHANICAL, 4, false},
    {"constant_load", true, MECHANICAL, 4, false},
    {"gravity_unbalance", true, ROTARY, 4, false},
    {"cogging", true, MECHANICAL, 4, false},
    {"torque_ripple", true, MECHANICAL, 4, false},
    {"eccentric_friction", true, ROTARY, 4, false},
    {"backlash", true, MECHANICAL, 6, false},
    {"compliance", true, MECHANICAL, 4, false},
    {"delay", true, "rigid_axis linear_axis", 3, false},
    {"torque_saturation", true, "rigid_axis linear_axis dc_drive pmsm_drive", 3, false},
    {"resistance_drift", true, ELECTRICAL, 4, true},
    {"dead_time_voltage", true, ELECTRICAL, 4, true},
    {"current_offset", true, "rigid_axis dc_drive pmsm_drive", 4, false},
    {"encoder_eccentricity", true, ROTARY, 4, false},
    {"inertia_change", true, MECHANICAL, 4, false},
    {"friction_drift", true, MECHANICAL, 4, false},
    {"hysteresis", true, MECHANICAL, 4, false},
    {"dead_zone", true, "rigid_axis linear_axis", 4, false},
    {"cubic_spring", false, MECHANICAL, 4, false},
    {"position_inertia", false, ROTARY, 2, false},
    {"eddy_brake", false, MECHANICAL, 4, false},
    {"random_walk_load", false, MECHANICAL, 4, false},
    {"warm_spot_friction", false, ROTARY, 4, false},
    {"gear_mesh", false, ROTARY, 4, false},
    {"end_stop", false, MECHANICAL, 6, false},
    {"parametric_belt", false, ROTARY, 1.6, false},
};

// Period of what repeats with position: a turn, or a pole pitch of 10 to 40 mm on a linear axis.
double per_turn(const Drive &d, Random &rng) { return d.linear ? 2 * M_PI / rng.uniform(0.010, 0.040) : 1.0; }

std::vector<Harmonic> harmonics(const Drive &d, double amplitude, Random &rng) {
    static const int orders[] = {6, 7, 8, 9, 10, 12, 14, 15, 18, 20, 21, 24, 28, 30, 36, 42, 48};
    const double unit = per_turn(d, rng);
    const double order = d.linear ? rng.integer(1, 2) : orders[rng.integer(0, 16)];
    std::vector<Harmonic> out{{amplitude, unit * order, rng.uniform(-M_PI, M_PI)}};
    if (rng.chance(0.4)) out.push_back({amplitude * rng.uniform(0.15, 0.5), 2 * unit * order, rng.uniform(-M_PI, M_PI)});
    return out;
}

using Filler = std::function<void(double x, const Drive &d, double T, Random &rng, Hidden &h)>;

const std::map<std::string, Filler> FILLERS = {
    {"coulomb", [](double x, const Drive &d, double, Random &, Hidden &h) { h.tau_c = 0.15 * d.T_rated * x; }},
    {"stribeck", [](double x, const Drive &d, double, Random &r, Hidden &h) {
        h.tau_c = 0.10 * d.T_rated * x; h.tau_s = h.tau_c * r.uniform(1.5, 2.2); h.omega_s = d.w_max * r.log_uniform(0.02, 0.10); }},
    {"lugre", [](double x, const Drive &d, double, Random &r, Hidden &h) {
        h.lugre_c = 0.10 * d.T_rated * x; h.lugre_s = h.lugre_c * r.uniform(1.3, 2.0); h.lugre_w = d.w_max * r.log_uniform(0.02, 0.08);
        const double give = (d.linear ? 1e-4 : 1e-2) * r.log_uniform(0.3, 1.5);
        h.lugre_k = h.lugre_s / give; h.lugre_d = r.uniform(0.2, 0.5) * 2 * std::sqrt(h.lugre_k * d.J); }},
    {"asymmetric_friction", [](double x, const Drive &d, double, Random &r, Hidden &h) {
        if (r.chance(0.5)) { const double s = r.sign(); h.tau_c = 0.12 * d.T_rated * x; h.asymmetry_c = s * h.tau_c * r.uniform(0.3, 0.7); }
        else h.asymmetry_B = r.sign() * 0.12 * d.T_rated / d.w_max * x; }},
    {"load_dependent_friction", [](double x, const Drive &, double, Random &, Hidden &h) { h.mu = std::min(0.15 * x, 0.6); }},
    {"quadratic_drag", [](double x, const Drive &d, double, Random &, Hidden &h) { h.drag = 0.25 * d.T_rated / (d.w_max * d.w_max) * x; }},
    {"constant_load", [](double x, const Drive &d, double, Random &r, Hidden &h) { h.load = r.sign() * 0.12 * d.T_rated * x; }},
    {"gravity_unbalance", [](double x, const Drive &d, double, Random &r, Hidden &h) {
        h.unbalance = 0.2 * d.T_rated * x; h.unbalance_phase = r.uniform(-M_PI, M_PI); }},
    {"cogging", [](double x, const Drive &d, double, Random &r, Hidden &h) { h.cogging = harmonics(d, 0.06 * d.T_rated * x, r); }},
    {"torque_ripple", [](double x, const Drive &d, double, Random &r, Hidden &h) { h.ripple = harmonics(d, 0.15 * x, r); }},
    {"eccentric_friction", [](double x, const Drive &d, double, Random &r, Hidden &h) {
        h.eccentric_order = r.integer(1, 2); h.eccentric_phase = r.uniform(-M_PI, M_PI);
        if (d.coulomb > 0) { h.eccentric = std::min(0.4 * x, 0.95); }
        else { h.tau_c = 0.12 * d.T_rated * x; h.eccentric = r.uniform(0.5, 0.9); } }},
    {"backlash", [](double x, const Drive &d, double, Random &r, Hidden &h) {
        h.load_share = r.uniform(0.3, 0.75);
        const double w = 2 * M_PI * r.uniform(150, 350);  // contact resonance
        h.spring = h.load_share * (1 - h.load_share) * d.J * w * w;
        h.spring_damper = 2 * r.uniform(0.1, 0.4) * h.load_share * (1 - h.load_share) * d.J * w;
        h.gap = (d.linear ? 1e-4 : 0.01) * x; }},
    {"compliance", [](double x, const Drive &d, double, Random &r, Hidden &h) {
        h.load_share = r.uniform(0.3, 0.75);
        const double w = 2 * M_PI * r.uniform(18, 35) / std::sqrt(x);
        const double J = h.load_share * (1 - h.load_share) * d.J;
        h.spring = J * w * w; h.spring_damper = 2 * r.log_uniform(0.01, 0.08) * J * w; }},
    {"delay", [](double x, const Drive &, double, Random &, Hidden &h) { h.delay_s = 0.006 * x; }},
    {"torque_saturation", [](double x, const Drive &d, double, Random &, Hidden &h) { h.i_saturation = 3.0 * d.I_rated / std::sqrt(x); }},
    {"resistance_drift", [](double x, const Drive &, double T, Random &r, Hidden &h) { h.heat_rise = 150 * x; h.heat_tau_s = T * r.uniform(0.3, 1.0); }},
    {"dead_time_voltage", [](double x, const Drive &d, double, Random &, Hidden &h) { h.dead_voltage = 0.02 * d.V_bus * x; }},
    {"current_offset", [](double x, const Drive &d, double, Random &r, Hidden &h) { h.current_offset = r.sign() * 0.06 * d.I_rated * x; }},
    {"encoder_eccentricity", [](double x, const Drive &, double, Random &r, Hidden &h) {
        h.encoder_amplitude = 0.02 * x; h.encoder_phase = r.uniform(-M_PI, M_PI); }},
    {"inertia_change", [](double x, const Drive &d, double T, Random &r, Hidden &h) {
        const double s = r.sign(); h.inertia_step = (s > 0 ? 0.4 * x : -std::min(0.3 * x, 0.7)) * d.J; h.inertia_at_s = T * r.uniform(0.3, 0.6); }},
    {"friction_drift", [](double x, const Drive &d, double T, Random &r, Hidden &h) {
        h.friction_drift_tau_s = T * r.uniform(0.3, 0.8);
        if (d.coulomb > 0) { h.friction_drift = r.chance(0.6) ? -std::min(0.5 * x, 0.85) : 0.6 * x; }
        else { h.friction_drift = 1.5 * x; } }},
    {"hysteresis", [](double x, const Drive &d, double, Random &r, Hidden &h) {
        h.dahl = 0.12 * d.T_rated * x; h.dahl_span = (d.linear ? 4e-3 : 1.0) * r.uniform(0.04, 0.25); }},
    {"dead_zone", [](double x, const Drive &d, double, Random &, Hidden &h) { h.dead_zone = 0.12 * d.T_rated * x; }},
    {"cubic_spring", [](double x, const Drive &d, double, Random &, Hidden &h) { h.cubic = 0.25 * d.T_rated / std::pow(d.range, 3) * x; }},
    {"position_inertia", [](double x, const Drive &, double, Random &r, Hidden &h) {
        h.inertia_wave = std::min(0.25 * x, 0.6); h.inertia_wave_order = r.integer(1, 2); h.inertia_wave_phase = r.uniform(-M_PI, M_PI); }},
    {"eddy_brake", [](double x, const Drive &d, double, Random &r, Hidden &h) {
        h.eddy_w = d.w_max * r.uniform(0.08, 0.25); h.eddy = 0.3 * d.T_rated / h.eddy_w * x; }},
    {"random_walk_load", [](double x, const Drive &d, double, Random &r, Hidden &h) { h.walk = 0.08 * d.T_rated * x; h.walk_tau_s = r.uniform(0.4, 2.0); }},
    {"warm_spot_friction", [](double x, const Drive &d, double T, Random &r, Hidden &h) {
        h.warm_spot = 0.12 * d.T_rated * x; h.warm_spot_phase = r.uniform(-M_PI, M_PI); h.warm_spot_tau_s = 0.2 * T; }},
    {"gear_mesh", [](double x, const Drive &d, double, Random &r, Hidden &h) {
        h.mesh = 0.05 * d.T_rated * x; h.mesh_order = r.integer(9, 24); h.mesh_w = 2 * M_PI * r.uniform(8, 20) / h.mesh_order; }},
    {"end_stop", [](double x, const Drive &d, double, Random &r, Hidden &h) {
        h.stop = 0.10 * d.T_rated * x; h.stop_at = r.uniform(0.2, 0.45) * d.range; h.stop_width = r.uniform(0.03, 0.1) * d.range; }},
    {"parametric_belt", [](double x, const Drive &d, double, Random &r, Hidden &h) {
        h.load_share = r.uniform(0.3, 0.7);
        const double w = 2 * M_PI * r.uniform(14, 24) / std::sqrt(x), J = h.load_share * (1 - h.load_share) * d.J;
        h.spring = J * w * w; h.spring_damper = 2 * 0.05 * J * w; h.belt = 0.6; h.belt_order = r.integer(1, 3); }},
};

}  // namespace

const std::vector<EffectEntry> &effect_table() { return TABLE; }

const EffectEntry *find_effect(const std::string &name) {
    for (const auto &entry : TABLE) if (name == entry.name) return &entry;
    return nullptr;
}

void add_effect(const std::string &name, double size, const Drive &drive, double record_s, std::uint64_t seed, Hidden &hidden) {
    if (name == "none") return;
    const auto filler = FILLERS.find(name);
    if (filler == FILLERS.end()) throw std::invalid_argument("unknown effect '" + name + "': `driveid-sim effects` lists them");
    Random shape(seed, "shape " + name);
    filler->second(size, drive, record_s, shape, hidden);
}

std::vector<TrueParameter> effect_parameters(const std::string &name, const Drive &d, const Hidden &h) {
    std::vector<TrueParameter> out;
    auto torque = [&out](const char *key, double value) { out.push_back({key, value, true}); };
    auto plain = [&out](const char *key, double value) { out.push_back({key, value, false}); };
    const double J_l = h.load_share * d.J;
    if (name == "coulomb") torque("tau_c", h.tau_c);
    if (name == "stribeck") { torque("tau_c", h.tau_c); torque("tau_s", h.tau_s); plain("omega_s", h.omega_s); }
    if (name == "lugre") { torque("tau_c", h.lugre_c); torque("tau_s", h.lugre_s); plain("omega_s", h.lugre_w); torque("sigma_0", h.lugre_k); torque("sigma_1", h.lugre_d); }
    if (name == "asymmetric_friction") { torque("tau_c_pos", h.tau_c + h.asymmetry_c); torque("tau_c_neg", h.tau_c - h.asymmetry_c); torque("dB", h.asymmetry_B); }
    if (name == "load_dependent_friction") plain("mu", h.mu);
    if (name == "quadratic_drag") torque("c", h.drag);
    if (name == "constant_load") torque("tau_0", h.load);
    if (name == "gravity_unbalance") { torque("tau_g", h.unbalance); plain("theta_0", h.unbalance_phase); }
    if (name == "cogging" && !h.cogging.empty()) { torque("A", h.cogging[0].amplitude); plain("N", h.cogging[0].order); plain("phi", h.cogging[0].phase); }
    if (name == "torque_ripple" && !h.ripple.empty()) { plain("a", h.ripple[0].amplitude); plain("N", h.ripple[0].order); plain("phi", std::remainder(h.ripple[0].phase + M_PI, 2 * M_PI)); }  // stated as a loss
    if (name == "eccentric_friction") { torque("tau_c", d.coulomb + h.tau_c); plain("e", h.eccentric); plain("n", h.eccentric_order); plain("phi", h.eccentric_phase); }
    if (name == "backlash") { plain("gap", h.gap); torque("J_l", J_l); torque("k", h.spring); torque("d", h.spring_damper); }
    if (name == "compliance") { torque("J_l", J_l); torque("k", h.spring); torque("d", h.spring_damper); }
    if (name == "delay") plain("T_d", h.delay_s);
    if (name == "torque_saturation") plain("i_sat", h.i_saturation);
    if (name == "resistance_drift") { plain("heat_rise", h.heat_rise); plain("T_th", h.heat_tau_s); }
    if (name == "dead_time_voltage") plain("V_d", h.dead_voltage);
    if (name == "current_offset") plain("i_0", h.current_offset);
    if (name == "encoder_eccentricity") { plain("a", h.encoder_amplitude); plain("phi", h.encoder_phase); }
    if (name == "inertia_change") { torque("dJ", h.inertia_step); plain("t_step", h.inertia_at_s); }
    if (name == "friction_drift") { torque("dtau_c", h.friction_drift * d.coulomb); torque("dB", h.friction_drift * d.B); plain("T_w", h.friction_drift_tau_s); }
    if (name == "hysteresis") { torque("tau_h", h.dahl); plain("theta_h", h.dahl_span); }
    if (name == "dead_zone") torque("u_d", h.dead_zone);
    return out;
}

}  // namespace sim
