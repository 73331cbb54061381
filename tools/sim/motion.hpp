// SPDX-License-Identifier: Apache-2.0
// Motion programs: an endless, seeded sequence of segments, each a speed reference with bounded acceleration.
#pragma once
#include "drive.hpp"
#include "random.hpp"

namespace sim {

struct Reference { double q = 0, w = 0, a = 0, extra_torque = 0; };

class Motion {
public:
    // program: "mixed" (all kinds), or one of p2p jog rest reversal prbs chirp slow steady
    Motion(const Drive &drive, std::uint64_t seed, const std::string &program = "mixed");
    Reference tick(double dt_s);  // reference at the end of the next dt_s
    const std::string &segment() const { return kind_; }

private:
    void begin();
    double wanted_speed();
    Drive d_;
    Random rng_;
    std::string program_, kind_;
    int count_ = 0;
    double t_ = 0, length_ = 0, w_ = 0, q_ = 0;                     // within the segment; reference state
    double speed_ = 0, target_ = 0, accel_ = 0, f0_ = 1, f1_ = 1;  // of the segment
    double next_flip_ = 0, torque_ = 0, phase_ = 0;
};

}  // namespace sim
