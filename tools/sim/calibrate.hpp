// SPDX-License-Identifier: Apache-2.0
// How large is a hidden effect for the person who only has the record? The best nominal fit of the torque (or voltage)
// balance, seen through a smooth window of a few tens of milliseconds, against the same balance with the hidden
// part known exactly. Their ratio is the size of a case: 10, 3, 1.2, 1.05, 1.01.
#pragma once
#include "run.hpp"

namespace sim {

struct Balance {
    double floor = 0;       // RMS with the hidden part known: sensor noise, quantisation, sampling
    double structural = 0;  // RMS that the hidden part leaves after the best nominal fit, without any noise
    double ratio() const;   // nominal error over floor
    double measured = 0;    // the same ratio taken from the noisy record alone, as a check
    double significance = 0;  // t-like statistic of the true hidden regressor in the noisy record
};

Balance weigh(const Setup &setup, const std::vector<Truth> &truth, const std::vector<Reading> &readings, bool electrical);

// Finds the effect size (and, where its realistic bound is reached, the sensor noise) at which weigh().ratio() is the target.
struct Calibration { double size = 0; Balance balance; };
Calibration calibrate(Setup &setup, const std::string &effect, double target_ratio, double seconds, const Hidden &base);

}  // namespace sim
