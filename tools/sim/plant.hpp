// SPDX-License-Identifier: Apache-2.0
// The physics, integrated with a step far below the log period. Dry friction is a state machine (stick, slip forward,
// slip backward) with the instant of standstill found inside a step; the gap has real one-sided contact.
#pragma once
#include "drive.hpp"
#include "random.hpp"

namespace sim {

struct PlantState {
    double t = 0;
    double q = 0, w = 0, q_l = 0, w_l = 0;
    double i = 0, i_d = 0;                 // armature or q current; d current
    double bristle = 0, dahl = 0, heat = 0, walk = 0, warm = 0;
    int mode = 0;                          // -1, +1 slip; 0 stick
};

class Plant {
public:
    Plant(const Drive &drive, const Hidden &hidden, double step_s, std::uint64_t seed);
    void step(double v, double v_d);       // one step with constant terminal voltages
    void set_drive(const Drive &drive) { d_ = drive; }
    void set_hidden(const Hidden &hidden);
    const PlantState &state() const { return s_; }
    PlantState &state() { return s_; }
    double encoder() const;                // angle as the encoder sees it, before quantisation
    double electric_torque() const;        // nominal torque of the present current
    double coulomb_share() const { return coulomb_share_; }  // known dry friction now, as a share of its level
    double temperature() const;
    double dissipated_J() const { return dissipated_; }      // energy turned into heat by friction of every kind
    double step_s() const { return h_; }

private:
    struct Rate { double w_dot, w_l_dot; };
    double drive_torque();
    double warming() const;
    double smooth(double q, double w) const;                 // torque without dry friction, opposing positive
    double dry_level(double w, int direction) const;
    double stiction(int direction) const;
    double coupling(double q, double w, double q_l, double w_l) const;
    double inertia(double q) const;
    double inertia_slope(double q) const;
    Rate rate(double q, double w, double q_l, double w_l, int mode) const;
    void slide(double h, int mode);
    void mechanics();
    void electrics(double v, double v_d);
    void slow_states();

    Drive d_;
    Hidden x_;
    double h_;
    PlantState s_;
    Random noise_;
    std::vector<double> past_;             // delay line of the torque
    std::size_t head_ = 0;
    double torque_ = 0, torque_end_ = 0, w_before_ = 0, coulomb_share_ = 0, dissipated_ = 0;
    bool dry_ = false, two_ = false;
};

}  // namespace sim
