// SPDX-License-Identifier: Apache-2.0
// A winding that is sampled about once in its time constant, with the voltage's mean over each sample and the current's instants: nobody tells fit
// so, and half a sample is worth some hundredths of such a resistance and half of its inductance. The intervals must know.
#include <gtest/gtest.h>

#include "fitted.hpp"

namespace {

constexpr double R_ohm = 0.8, L_H = 1e-3, K_e_Vs_rad = 0.05;

// Integrated in 50 steps a sample; voltage steps at each sample, a motor of 20 ms that is loaded by slow random torques.
records::Record winding(uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  records::Record r;
  r.hold = nullptr;
  const double dt = 1e-3, h = dt / 50, J = 6e-5;
  double i = 0, w = 0, angle = 0, volts = 0, load = 0;
  for (int k = 0; k < 8000; k++) {
    if (k % 40 == 0) volts = 6 * normal(random);
    load += 0.02 * (0.03 * normal(random) - 0.02 * load);
    const double v = volts + normal(random);
    for (int s = 0; s < 50; s++) {
      i += h * (v - R_ohm * i - K_e_Vs_rad * w) / L_H;
      w += h * (K_e_Vs_rad * i - 1e-4 * w - load) / J;
      angle += h * w;
    }
    r.t.push_back(int64_t(k + 1) * 1000000);
    r.column["v_V"].push_back(v + 0.01 * normal(random));
    r.column["i_A"].push_back(i + 0.01 * normal(random));
    r.column["theta_rad"].push_back(angle + 2e-5 * normal(random));
  }
  return r;
}

}  // namespace

TEST(Circuit, intervals_of_a_winding_sampled_once_in_its_time_constant) {
  const std::pair<const char *, double> truth[] = {{"R_ohm", R_ohm}, {"L_H", L_H}, {"K_e_Vs_rad", K_e_Vs_rad}};
  int inside = 0, all = 0;
  for (uint32_t seed = 1; seed <= 5; seed++) {
    std::vector<records::Record> training{winding(seed)};
    const json document = fit("format = 1\nstructure = \"dc_circuit\"\n", training);
    for (const auto &[name, value] : truth) {
      const json &p = document["parameters"][name];
      const double lo = p["interval"][0], hi = p["interval"][1];
      std::printf("| %d | %s | %.4g | %.5g %.5g |\n", int(seed), name, value, lo, hi);
      if (name == truth[2].first) {
        EXPECT_NEAR(p["value"].get<double>(), value, 1e-3 * value);   // the speed is the slope over nine samples: good to some parts in ten thousand
        continue;
      }
      all++;
      inside += lo <= value && value <= hi;
      EXPECT_LT(hi - lo, 0.3 * value) << name;   // an interval that says nothing covers too
    }
  }
  EXPECT_GE(inside, 8) << "of " << all;   // fewer of 10 have a chance of 1 % at 95 %
}
