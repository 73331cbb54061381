// SPDX-License-Identifier: Apache-2.0
// The drive's own controller: current loop at 8 kHz, speed and position loop at 1 kHz, on quantised feedback; or open loop
// (the reference's feed-forward torque alone).
#pragma once
#include "drive.hpp"
#include "motion.hpp"

namespace sim {

class Control {
public:
    static constexpr double tick_s = 1.0 / 8000.0;
    static constexpr int speed_ticks = 8;

    Control(const Drive &drive, bool open_loop, int phase = 0, double inject_d = 0)
        : d_(drive), open_(open_loop), inject_d_(inject_d), ticks_(phase) {}
    struct Volts { double v = 0, v_d = 0; };
    // Called every tick_s with what the sensors say.
    Volts tick(const Reference &reference, double q, double i, double i_d);
    bool speed_turn() const { return ticks_ % speed_ticks == 0; }

private:
    void speed_loop(const Reference &reference, double q);
    Drive d_;
    bool open_;
    double inject_d_;                      // A: square wave on the d current, so that L_d shows
    int ticks_, d_left_ = 0, d_count_ = 0;
    bool first_ = true;
    double q_last_ = 0, w_ = 0, integral_ = 0, i_ref_ = 0, sum_ = 0, sum_d_ = 0, d_ref_ = 0;
    Volts next_;
};

}  // namespace sim
