// SPDX-License-Identifier: Apache-2.0
#include "run.hpp"

#include <cmath>

namespace sim {

Run::Run(const Setup &setup, std::uint64_t record)
    : setup_(setup),
      plant_(setup.drive, setup.hidden, Control::tick_s / setup.substeps, setup.seed * 31 + record),
      control_(setup.drive, setup.open_loop, setup.sensors.phase, setup.inject_d),
      motion_(setup.drive, setup.seed * 31 + record, setup.program),
      noise_(setup.seed * 31 + record, "sensors"),
      ticks_per_sample_(static_cast<int>(std::lround(1.0 / (Control::tick_s * setup.sensors.rate_Hz)))) {}

double Run::quantised(double q) const {
    const double step = (setup_.drive.linear ? 1.0 : 2 * M_PI) / setup_.drive.counts;
    return step * std::floor(q / step + 0.5);
}

Truth Run::advance() {
    Truth out;
    const auto &d = setup_.drive;
    const double offset = setup_.hidden.current_offset;
    for (int tick = 0; tick < ticks_per_sample_; ++tick) {
        if (control_.speed_turn()) reference_ = motion_.tick(Control::speed_ticks * Control::tick_s);
        const auto &s = plant_.state();
        const auto volts = control_.tick(reference_, quantised(plant_.encoder()), s.i + offset, s.i_d);
        for (int n = 0; n < setup_.substeps; ++n) {
            const double i_before = s.i, d_before = s.i_d, torque_before = plant_.electric_torque();
            plant_.step(volts.v, volts.v_d);
            out.i_mean += 0.5 * (i_before + s.i);
            out.i_d_mean += 0.5 * (d_before + s.i_d);
            out.torque_mean += 0.5 * (torque_before + plant_.electric_torque());
            out.coulomb_mean += plant_.coulomb_share();
        }
        out.v_mean += volts.v; out.v_d_mean += volts.v_d;
        out.v = volts.v; out.v_d = volts.v_d;
    }
    const double steps = ticks_per_sample_ * setup_.substeps;
    const auto &s = plant_.state();
    out.i_mean = out.i_mean / steps + offset; out.i_d_mean /= steps;
    out.torque_mean = out.torque_mean / steps + d.K_t * offset;
    out.coulomb_mean /= steps;
    out.v_mean /= ticks_per_sample_; out.v_d_mean /= ticks_per_sample_;
    out.t = s.t; out.q = s.q; out.w = s.w; out.q_encoder = plant_.encoder();
    out.i = s.i + offset; out.i_d = s.i_d;
    out.torque = plant_.electric_torque() + d.K_t * offset;
    out.T = plant_.temperature();
    return out;
}

Reading Run::read(const Truth &x) {
    const auto &n = setup_.sensors;
    const double m = setup_.noise, dt = 1.0 / n.rate_Hz;
    double white = noise_.normal();
    coloured_ = n.colour_i * coloured_ + std::sqrt(1 - n.colour_i * n.colour_i) * white;
    const double i_noise = m * n.sigma_i * coloured_;
    Reading r;
    r.t = x.t;
    r.i = (n.average ? x.i_mean : x.i) + i_noise;
    r.i_d = (n.average ? x.i_d_mean : x.i_d) + m * n.sigma_i * noise_.normal();
    r.torque = (n.average ? x.torque_mean : x.torque) + setup_.drive.K_t * i_noise;
    r.v = x.v_mean + m * n.sigma_v * noise_.normal();
    r.v_d = x.v_d_mean + m * n.sigma_v * noise_.normal();
    r.q = quantised(x.q_encoder + m * n.sigma_q * noise_.normal());
    const double tacho = x.w + m * n.sigma_w * noise_.normal();
    if (first_) { q_last_ = r.q; w_encoder_ = tacho; first_ = false; }
    w_encoder_ += (1 - std::exp(-dt / 0.002)) * ((r.q - q_last_) / dt - w_encoder_);
    q_last_ = r.q;
    r.w = n.tacho ? tacho : w_encoder_;
    r.T = x.T + n.sigma_T * noise_.normal();
    return r;
}

std::vector<Truth> simulate(const Setup &setup, std::uint64_t record, double seconds, std::vector<Reading> *readings) {
    Run run(setup, record);
    const auto rows = static_cast<std::size_t>(seconds * setup.sensors.rate_Hz);
    std::vector<Truth> out;
    out.reserve(rows);
    if (readings) { readings->clear(); readings->reserve(rows); }
    for (std::size_t n = 0; n < rows; ++n) {
        out.push_back(run.advance());
        if (readings) readings->push_back(run.read(out.back()));
    }
    return out;
}

}  // namespace sim
