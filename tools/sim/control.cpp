// SPDX-License-Identifier: Apache-2.0
#include "control.hpp"

#include <algorithm>
#include <cmath>

namespace sim {

void Control::speed_loop(const Reference &reference, double q) {
    const double dt = speed_ticks * tick_s;
    if (first_) { q_last_ = q; first_ = false; }
    w_ += 0.5 * ((q - q_last_) / dt - w_);  // short filter over the encoder's steps
    q_last_ = q;
    const double feed = d_.J * reference.a + d_.B * reference.w + reference.extra_torque;
    double torque = feed;
    if (!open_) {
        const double w_ref = reference.w + 0.25 * d_.loop_w * (reference.q - q);
        const double error = w_ref - w_, gain = d_.J * d_.loop_w;
        const double limit = 2.5 * d_.T_rated;
        torque = d_.feed_forward * (d_.J * reference.a) + reference.extra_torque + gain * error + integral_;
        if (std::fabs(torque) < limit) integral_ += 0.25 * d_.loop_w * gain * error * dt;
    }
    const double limit = 2.5 * d_.I_rated;
    i_ref_ = std::clamp(torque / d_.K_t, -limit, limit);
}

Control::Volts Control::tick(const Reference &reference, double q, double i, double i_d) {
    if (ticks_ % speed_ticks == 0) speed_loop(reference, q);
    ++ticks_;
    const Volts out = next_;  // the voltage computed in the last period is applied in this one
    const double L_q = d_.pmsm ? d_.L_q : d_.L, L_d = d_.pmsm ? d_.L_d : d_.L, c = d_.loop_current_w;
    const double w_e = d_.pmsm ? d_.pole_pairs * w_ : 0.0;
    const double back = d_.pmsm ? w_e * (d_.L_d * i_d + d_.psi) : d_.K_e * w_;
    const double error = i_ref_ - i, v = L_q * c * error + sum_ + back;
    next_.v = std::clamp(v, -d_.V_bus, d_.V_bus);
    if (v == next_.v) sum_ += d_.R * c * error * tick_s;
    if (d_.pmsm) {
        static constexpr int PERIODS[] = {184, 328, 136, 456};  // ticks; an uneven beat, so that many frequencies are excited
        if (--d_left_ <= 0) { d_left_ = PERIODS[d_count_++ % 4]; d_ref_ = d_ref_ > 0 ? -inject_d_ : inject_d_; }
        const double error_d = d_ref_ - i_d, v_d = L_d * c * error_d + sum_d_ - w_e * d_.L_q * i;
        next_.v_d = std::clamp(v_d, -d_.V_bus, d_.V_bus);
        if (v_d == next_.v_d) sum_d_ += d_.R * c * error_d * tick_s;
    }
    return out;
}

}  // namespace sim
