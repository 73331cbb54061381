// SPDX-License-Identifier: Apache-2.0
#include "plant.hpp"

#include <algorithm>
#include <cmath>

namespace sim {

Plant::Plant(const Drive &drive, const Hidden &hidden, double step_s, std::uint64_t seed)
    : d_(drive), h_(step_s), noise_(seed, "plant") { set_hidden(hidden); }

void Plant::set_hidden(const Hidden &hidden) {
    const bool was_two = two_;
    x_ = hidden;
    two_ = x_.load_share > 0;
    dry_ = d_.coulomb > 0 || x_.tau_c > 0 || x_.asymmetry_c != 0 || x_.mu > 0 || x_.warm_spot > 0;
    if (two_ && !was_two) { s_.q_l = s_.q; s_.w_l = s_.w; }
    const auto length = static_cast<std::size_t>(std::lround(x_.delay_s / h_));
    if (past_.size() != length) { past_.assign(length, electric_torque()); head_ = 0; }
}

// How far the machine has warmed up, 0 to 1: friction drifts with it, and a sensor shows it.
double Plant::warming() const { return 1 - std::exp(-s_.t / x_.friction_drift_tau_s); }

double Plant::temperature() const {
    return 25.0 + s_.heat + 0.6 * s_.warm + (x_.friction_drift != 0 ? 30.0 * warming() : 0.0);
}

double Plant::encoder() const {
    return s_.q + x_.encoder_amplitude * std::sin(s_.q + x_.encoder_phase);
}

double Plant::electric_torque() const {
    if (!d_.pmsm) return d_.K_t * s_.i;
    return 1.5 * d_.pole_pairs * (d_.psi + (d_.L_d - d_.L_q) * s_.i_d) * s_.i;
}

// Torque on the shaft: what the current makes, after iron, threshold, ripple and dead time.
double Plant::drive_torque() {
    double torque = electric_torque();
    if (x_.i_saturation > 0) {
        const double r = s_.i / x_.i_saturation;
        torque /= 1 + r * r;
    }
    if (x_.dead_zone > 0) torque = std::copysign(std::max(std::fabs(torque) - x_.dead_zone, 0.0), torque);
    for (const auto &r : x_.ripple) torque *= 1 + r.amplitude * std::sin(r.order * s_.q + r.phase);
    if (past_.empty()) return torque;
    const double delayed = past_[head_];
    past_[head_] = torque;
    head_ = (head_ + 1) % past_.size();
    return delayed;
}

double Plant::smooth(double q, double w) const {
    const double drift = 1 + x_.friction_drift * warming();
    double torque = (d_.B + (w > 0 ? x_.asymmetry_B : -x_.asymmetry_B)) * w * drift;
    torque += x_.drag * std::fabs(w) * w + x_.load;
    if (x_.unbalance != 0) torque += x_.unbalance * std::sin(q - x_.unbalance_phase);
    for (const auto &c : x_.cogging) torque += c.amplitude * std::sin(c.order * q + c.phase);
    if (x_.cubic != 0) torque += x_.cubic * q * q * q;
    if (x_.eddy != 0) torque += x_.eddy * w / (1 + (w / x_.eddy_w) * (w / x_.eddy_w));
    if (x_.mesh != 0) {
        const double r = std::fabs(w) / x_.mesh_w, detune = (1 - r * r);
        torque += x_.mesh * std::sin(x_.mesh_order * q) * r / std::sqrt(detune * detune + 0.04 * r * r);
    }
    if (x_.stop != 0) torque += x_.stop * (1 + std::tanh((q - x_.stop_at) / x_.stop_width));
    return torque + s_.walk + s_.dahl;
}

// Level of dry friction while sliding in a direction (>= 0).
double Plant::dry_level(double w, int direction) const {
    double level = d_.coulomb + x_.tau_c;
    if (x_.tau_s > x_.tau_c) { const double r = w / x_.omega_s; level += (x_.tau_s - x_.tau_c) * std::exp(-r * r); }
    if (x_.eccentric != 0) level *= 1 + x_.eccentric * std::cos(x_.eccentric_order * s_.q + x_.eccentric_phase);
    level *= 1 + x_.friction_drift * warming();
    level += direction * x_.asymmetry_c + x_.mu * std::fabs(torque_);
    if (x_.warm_spot > 0) level += x_.warm_spot * (1 + std::cos(s_.q - x_.warm_spot_phase)) * std::exp(-s_.warm / 8.0);
    return std::max(level, 0.0);
}

double Plant::stiction(int direction) const { return dry_level(0.0, direction); }

// Torque that the load takes from the motor through the shaft. With a gap, contact only pushes and its damping grows with
// penetration (Hunt and Crossley), so that it never pulls.
double Plant::coupling(double q, double w, double q_l, double w_l) const {
    const double twist = q - q_l, slip = w - w_l;
    double k = x_.spring;
    if (x_.belt != 0) k *= 1 + x_.belt * std::sin(x_.belt_order * q);
    if (x_.gap <= 0) return k * twist + x_.spring_damper * slip;
    const double half = 0.5 * x_.gap;
    if (std::fabs(twist) <= half) return 0;
    const double side = twist > 0 ? 1 : -1, depth = std::fabs(twist) - half;
    const double push = k * depth + x_.spring_damper * (depth / (depth + 0.05 * half)) * side * slip;
    return side * std::max(push, 0.0);
}

double Plant::inertia(double q) const {
    double J = d_.J;
    if (x_.inertia_step != 0 && s_.t >= x_.inertia_at_s) J += x_.inertia_step;
    if (x_.inertia_wave != 0) J *= 1 + x_.inertia_wave * std::cos(x_.inertia_wave_order * q + x_.inertia_wave_phase);
    return J;
}

double Plant::inertia_slope(double q) const {
    if (x_.inertia_wave == 0) return 0;
    return -d_.J * x_.inertia_wave * x_.inertia_wave_order * std::sin(x_.inertia_wave_order * q + x_.inertia_wave_phase);
}

Plant::Rate Plant::rate(double q, double w, double q_l, double w_l, int mode) const {
    double push = torque_ - smooth(q, w) - 0.5 * inertia_slope(q) * w * w;
    const double J = inertia(q);
    double lugre = 0;
    if (x_.lugre_k > 0) {
        const double r = w / x_.lugre_w, g = x_.lugre_c + (x_.lugre_s - x_.lugre_c) * std::exp(-r * r);
        lugre = x_.lugre_k * s_.bristle + x_.lugre_d * (w - x_.lugre_k * std::fabs(w) / g * s_.bristle);
    }
    push -= lugre;
    const double dry = dry_ ? mode * dry_level(w, mode) : 0.0;
    if (!two_) return {(push - dry) / J, 0};
    const double through = coupling(q, w, q_l, w_l), J_l = x_.load_share * J;
    return {(push - dry - through) / (J - J_l), through / J_l};
}

// Midpoint rule over h with the direction of dry friction held.
void Plant::slide(double h, int mode) {
    const Rate a = rate(s_.q, s_.w, s_.q_l, s_.w_l, mode);
    const double w_mid = s_.w + 0.5 * h * a.w_dot, w_l_mid = s_.w_l + 0.5 * h * a.w_l_dot;
    const double q_mid = s_.q + 0.5 * h * s_.w, q_l_mid = s_.q_l + 0.5 * h * s_.w_l;
    const Rate b = rate(q_mid, w_mid, q_l_mid, w_l_mid, mode);
    s_.q += h * w_mid; s_.w += h * b.w_dot;
    s_.q_l += h * w_l_mid; s_.w_l += h * b.w_l_dot;
}

void Plant::mechanics() {
    const double begin = torque_end_;
    torque_end_ = drive_torque();
    torque_ = 0.5 * (begin + torque_end_);  // of the middle of the step
    if (!dry_) { slide(h_, 0); coulomb_share_ = 0; return; }
    double left = h_;
    for (int round = 0; round < 3 && left > 0; ++round) {
        if (s_.mode == 0) {
            const double J_motor = two_ ? inertia(s_.q) * (1 - x_.load_share) : inertia(s_.q);
            const double push = rate(s_.q, 0, s_.q_l, s_.w_l, 0).w_dot * J_motor;
            const int direction = push > 0 ? 1 : -1;
            const double hold = stiction(direction);
            if (std::fabs(push) <= hold) {  // stays: only the load side moves
                s_.w = 0;
                const double q = s_.q;
                if (two_) { slide(left, 0); s_.q = q; s_.w = 0; }
                coulomb_share_ = hold > 0 ? push / hold : 0;
                return;
            }
            s_.mode = direction;
        }
        const PlantState before = s_;
        slide(left, s_.mode);
        if (s_.w * s_.mode >= 0) { coulomb_share_ = s_.mode; return; }
        const double part = before.w == s_.w ? 1 : std::clamp(before.w / (before.w - s_.w), 0.0, 1.0);
        const int mode = s_.mode;
        s_ = before;
        slide(part * left, mode);
        s_.w = 0; s_.mode = 0;
        coulomb_share_ = mode;
        left *= 1 - part;
    }
}

void Plant::electrics(double v, double v_d) {
    const double R = d_.R * (1 + 0.0039 * s_.heat);
    const double w_mid = s_.w + 0.5 * (s_.w - w_before_);
    w_before_ = s_.w;
    if (x_.dead_voltage > 0) v -= x_.dead_voltage * std::tanh(s_.i / (0.01 * d_.I_rated));
    if (!d_.pmsm) {
        const double rest = (v - d_.K_e * w_mid) / R;  // exact for the speed held over the step
        s_.i = rest + (s_.i - rest) * std::exp(-h_ * R / d_.L);
        return;
    }
    if (x_.dead_voltage > 0) v_d -= x_.dead_voltage * std::tanh(s_.i_d / (0.01 * d_.I_rated));
    const double w_e = d_.pole_pairs * w_mid;
    auto slope_d = [&](double i_d, double i_q) { return (v_d - R * i_d + w_e * d_.L_q * i_q) / d_.L_d; };
    auto slope_q = [&](double i_d, double i_q) { return (v - R * i_q - w_e * (d_.L_d * i_d + d_.psi)) / d_.L_q; };
    const double d_mid = s_.i_d + 0.5 * h_ * slope_d(s_.i_d, s_.i), q_mid = s_.i + 0.5 * h_ * slope_q(s_.i_d, s_.i);
    s_.i_d += h_ * slope_d(d_mid, q_mid);
    s_.i += h_ * slope_q(d_mid, q_mid);
}

// Bristles, hysteresis, heat and the wandering load: each exact for the speed of this step.
void Plant::slow_states() {
    const double w = s_.w;
    if (x_.lugre_k > 0) {
        const double r = w / x_.lugre_w, g = x_.lugre_c + (x_.lugre_s - x_.lugre_c) * std::exp(-r * r);
        const double pace = x_.lugre_k * std::fabs(w) / g;
        const double end = w == 0 ? s_.bristle : std::copysign(g / x_.lugre_k, w);
        s_.bristle = pace * h_ < 1e-9 ? s_.bristle + w * h_ : end + (s_.bristle - end) * std::exp(-pace * h_);
    }
    if (x_.dahl > 0 && w != 0) {
        const double end = std::copysign(x_.dahl, w);
        s_.dahl = end + (s_.dahl - end) * std::exp(-std::fabs(w) * h_ / x_.dahl_span);
    }
    if (x_.heat_rise > 0) {
        const double load = s_.i / d_.I_rated;
        s_.heat += h_ / x_.heat_tau_s * (x_.heat_rise * load * load - s_.heat);
    }
    if (x_.warm_spot > 0) {
        const double speed = w / d_.w_max;
        s_.warm += h_ / x_.warm_spot_tau_s * (60 * speed * speed - s_.warm);
    }
    if (x_.walk > 0) {
        const double pace = h_ / x_.walk_tau_s;
        s_.walk += -pace * s_.walk + x_.walk * std::sqrt(2 * pace) * noise_.normal();
    }
}

void Plant::step(double v, double v_d) {
    const double w = s_.w, q = s_.q;
    electrics(v, v_d);
    mechanics();
    slow_states();
    dissipated_ += (smooth(q, 0.5 * (w + s_.w)) - smooth(q, 0)) * (s_.q - q) +
                   std::fabs(coulomb_share_) * dry_level(w, s_.mode >= 0 ? 1 : -1) * std::fabs(s_.q - q);
    s_.t += h_;
}

}  // namespace sim
