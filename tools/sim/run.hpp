// SPDX-License-Identifier: Apache-2.0
// One drive running: plant, controller, motion and sensors, advanced one log sample at a time.
#pragma once
#include <memory>
#include <vector>

#include "control.hpp"
#include "drive.hpp"
#include "motion.hpp"
#include "plant.hpp"

namespace sim {

// What is true at a log instant, and its mean over the interval that ends there.
struct Truth {
    double t = 0;
    double q = 0, w = 0, q_encoder = 0;   // angle as the encoder sees it, without quantisation
    double i = 0, i_d = 0, v = 0, v_d = 0;
    double i_mean = 0, i_d_mean = 0, v_mean = 0, v_d_mean = 0, torque_mean = 0;  // torque of the nominal law
    double torque = 0, coulomb_mean = 0;  // coulomb: known dry friction as a share of its level
    double T = 25;
};

struct Setup {
    Drive drive;
    Hidden hidden;
    Sensors sensors;
    std::uint64_t seed = 1;
    std::string program = "mixed";
    bool open_loop = false;
    double inject_d = 0;   // A, on the d current of a PMSM
    double noise = 1;      // multiplies every sensor noise
    int substeps = 4;      // physics steps in a control tick
};

// What the logger writes: the sensors' readings.
struct Reading { double t = 0, i = 0, i_d = 0, v = 0, v_d = 0, torque = 0, q = 0, w = 0, T = 25; };

class Run {
public:
    Run(const Setup &setup, std::uint64_t record);   // record: 0 training, 1 held out, ...
    Truth advance();                                 // to the next log instant
    Reading read(const Truth &truth);                // one noisy reading of it
    Plant &plant() { return plant_; }
    Setup &setup() { return setup_; }

private:
    double quantised(double q) const;
    Setup setup_;
    Plant plant_;
    Control control_;
    Motion motion_;
    Random noise_;
    Reference reference_;
    int ticks_per_sample_;
    double coloured_ = 0, w_encoder_ = 0, q_last_ = 0;
    bool first_ = true;
};

std::vector<Truth> simulate(const Setup &setup, std::uint64_t record, double seconds, std::vector<Reading> *readings);

}  // namespace sim
