// SPDX-License-Identifier: Apache-2.0
// The simulated drive: its known physics, and everything hidden in it. SI units; q is the angle in rad (rotary) or the
// position in m (linear), so "torque" reads "force" on a linear axis.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

namespace sim {

struct Drive {
    std::string structure = "rigid_axis";
    bool linear = false, pmsm = false;
    double J = 1e-4, B = 1e-4;         // total inertia kg m^2, viscous friction N m s/rad
    double K_t = 0.05;                 // N m/A
    double R = 0.5, L = 1e-3, K_e = 0.05;
    double L_d = 1e-3, L_q = 1e-3, psi = 0.01;
    int pole_pairs = 4;
    double I_rated = 5, T_rated = 0.25, w_max = 200, a_max = 1000, V_bus = 48;
    double range = 60;                 // half of the travel, rad or m
    double counts = 8192;              // encoder counts per turn (rotary) or per metre (linear)
    double loop_w = 120, loop_current_w = 1800, feed_forward = 0.7;  // rad/s, rad/s, share
    double coulomb = 0;                // Coulomb friction that the nominal model already knows, N m
};

struct Harmonic { double amplitude = 0, order = 1, phase = 0; };

// Zero means absent. Which fields an effect fills is in effects.cpp.
struct Hidden {
    double tau_c = 0, tau_s = 0, omega_s = 1;                      // dry friction on top of Drive::coulomb
    double asymmetry_c = 0, asymmetry_B = 0;                       // N m, N m s/rad; positive direction has more
    double lugre_c = 0, lugre_s = 0, lugre_w = 1, lugre_k = 0, lugre_d = 0;
    double mu = 0;
    double drag = 0, load = 0, unbalance = 0, unbalance_phase = 0;
    std::vector<Harmonic> cogging, ripple;
    double eccentric = 0, eccentric_order = 1, eccentric_phase = 0;  // share of all dry friction
    double gap = 0, spring = 0, spring_damper = 0, load_share = 0;   // two masses where load_share > 0
    double delay_s = 0;
    double i_saturation = 0;
    double heat_rise = 0, heat_tau_s = 20;   // K at rated current, s; acts on R
    double dead_voltage = 0, current_offset = 0;
    double encoder_amplitude = 0, encoder_phase = 0;
    double inertia_step = 0, inertia_at_s = 0;
    double friction_drift = 0, friction_drift_tau_s = 10;  // share of all dry and viscous friction, reached exponentially
    double dahl = 0, dahl_span = 0.1;
    double dead_zone = 0;                    // N m of input torque
    // outside the catalogue
    double cubic = 0;                                          // N m/rad^3
    double inertia_wave = 0, inertia_wave_order = 2, inertia_wave_phase = 0;  // share of J
    double eddy = 0, eddy_w = 1;
    double walk = 0, walk_tau_s = 2;
    double warm_spot = 0, warm_spot_phase = 0, warm_spot_tau_s = 10;
    double mesh = 0, mesh_order = 20, mesh_w = 50;
    double stop = 0, stop_at = 1, stop_width = 0.1;
    double belt = 0, belt_order = 3;                           // share of spring stiffness that swings with angle
};

struct Sensors {
    double rate_Hz = 1000;
    int phase = 0;                          // control ticks between the speed loop's turn and the log instant
    double sigma_i = 0, colour_i = 0;       // A (rms), AR(1) pole of the current noise at the log rate
    double sigma_q = 0, sigma_w = 0, sigma_v = 0, sigma_T = 0.05;
    bool average = false;                   // inputs averaged over the sample instead of instantaneous
    bool has_q = true, has_w = false, has_T = false, has_tau = false, has_i = true;
    bool current_is_q = false;              // a rigid axis names its current i_q_A instead of i_A
    bool tacho = true;                      // speed from its own sensor, else from the encoder
    std::string dirt;                       // space-separated: dropped lag jitter glitch wrap k_t
};

}  // namespace sim
