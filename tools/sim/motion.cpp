// SPDX-License-Identifier: Apache-2.0
#include "motion.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace sim {

Motion::Motion(const Drive &drive, std::uint64_t seed, const std::string &program)
    : d_(drive), rng_(seed, "motion"), program_(program) { begin(); }

void Motion::begin() {
    static const char *const order[] = {"p2p", "slow", "reversal", "jog", "prbs", "rest", "p2p", "chirp", "slow", "jog", "rest", "reversal"};
    static int const kinds = static_cast<int>(std::size(order));
    if (program_ == "mixed") {
        if (count_ == 0) count_ = rng_.integer(0, kinds - 1) + kinds;
        kind_ = order[count_++ % kinds];
        if (rng_.chance(0.25)) kind_ = order[rng_.integer(0, kinds - 1)];
    } else if (program_ == "steady") {
        kind_ = count_++ % 3 == 2 ? "rest" : "steady";
    } else {
        kind_ = program_;
    }
    t_ = 0; torque_ = 0; phase_ = 0; next_flip_ = 0;
    accel_ = d_.a_max * rng_.uniform(0.35, 1.0);
    const double inward = q_ > 0.5 * d_.range ? -1 : q_ < -0.5 * d_.range ? 1 : rng_.sign();
    if (kind_ == "p2p") {
        target_ = rng_.uniform(0.3, 0.8) * d_.range * (q_ > 0 ? -1 : 1);
        speed_ = d_.w_max * rng_.uniform(0.5, 1.0);
        length_ = std::min(std::fabs(target_ - q_) / speed_ + speed_ / accel_ + rng_.uniform(0.1, 0.4), 4.0);
    } else if (kind_ == "jog") {
        speed_ = inward * d_.w_max * rng_.log_uniform(0.06, 1.0);
        length_ = rng_.uniform(0.6, 1.4);
    } else if (kind_ == "rest") {
        speed_ = 0; length_ = program_ == "steady" ? 5 : rng_.uniform(0.3, 0.9);
    } else if (kind_ == "steady") {  // a spindle: two slow speeds and a rest in turn, without an end to its travel
        speed_ = d_.w_max * rng_.log_uniform(0.02, 0.08);
        length_ = 10;
    } else if (kind_ == "reversal") {  // small and quick, so that the direction changes many times
        speed_ = d_.w_max * rng_.log_uniform(0.02, 0.3);
        f0_ = rng_.log_uniform(0.7, 4.0);
        length_ = std::min(5.0 / f0_, 3.0);
    } else if (kind_ == "prbs") {
        speed_ = d_.w_max * rng_.uniform(0.05, 0.35);
        length_ = rng_.uniform(1.0, 2.0);
        torque_ = d_.T_rated * rng_.uniform(0.05, 0.3);
    } else if (kind_ == "chirp") {
        speed_ = d_.w_max * rng_.uniform(0.1, 0.4);
        f0_ = 0.5; f1_ = rng_.uniform(5.0, 12.0);
        length_ = rng_.uniform(1.5, 3.0);
    } else {  // slow: a few turns at creeping speed, so that position and low speed show
        kind_ = "slow";
        speed_ = inward * d_.w_max * rng_.log_uniform(0.01, 0.06);
        length_ = rng_.uniform(1.8, 3.0);
    }
}

double Motion::wanted_speed() {
    double w = speed_;
    if (kind_ == "p2p") {
        const double rest = target_ - q_;
        w = std::copysign(std::min(speed_, std::sqrt(1.6 * accel_ * std::fabs(rest))), rest);
        if (std::fabs(rest) < 1e-4 * d_.range) w = 0;
    } else if (kind_ == "reversal") {
        w = speed_ * std::sin(2 * M_PI * f0_ * t_);
    } else if (kind_ == "chirp") {
        w = speed_ * std::sin(phase_);
    } else if (kind_ == "prbs") {
        if (t_ >= next_flip_) {
            next_flip_ = t_ + rng_.log_uniform(0.02, 0.25);
            if (rng_.chance(0.5)) speed_ = -speed_; else torque_ = -torque_;
        }
        w = speed_;
    }
    const bool outside = std::fabs(q_) > 0.9 * d_.range;  // turn back inside the travel
    if (outside && w * q_ > 0 && kind_ != "p2p" && program_ != "steady") w = speed_ = -0.5 * std::fabs(speed_) * (q_ > 0 ? 1 : -1);
    return std::clamp(w, -d_.w_max, d_.w_max);
}

Reference Motion::tick(double dt_s) {
    if (t_ >= length_) begin();
    const double f = f0_ * std::pow(f1_ / f0_, t_ / length_);
    phase_ += 2 * M_PI * f * dt_s;
    const double step = accel_ * dt_s, before = w_;
    w_ += std::clamp(wanted_speed() - w_, -step, step);
    q_ += dt_s * 0.5 * (w_ + before);
    t_ += dt_s;
    return {q_, w_, (w_ - before) / dt_s, kind_ == "prbs" ? torque_ : 0.0};
}

}  // namespace sim
