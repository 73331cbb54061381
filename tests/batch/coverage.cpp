// SPDX-License-Identifier: Apache-2.0
// Do the 95 % intervals of fit cover? A few runs a cell in the ordinary command, which a coverage below 80 % fails; DRIVEID_FULL=1 (ten minutes) makes
// a table to read.
#include <cstdlib>
#include <cstring>

#include <gtest/gtest.h>

#include "fitted.hpp"

namespace {

struct Tally { int inside = 0, all = 0; double width = 0; };

void count(std::map<std::string, Tally> &tally, const json &document, const std::map<std::string, double> &truth) {
  for (const auto &[name, value] : truth) {
    const json &p = document["parameters"][name];
    Tally &t = tally[name];
    t.all++;
    t.inside += p["interval"][0].get<double>() <= value && value <= p["interval"][1].get<double>();
    t.width += (p["interval"][1].get<double>() - p["interval"][0].get<double>()) / 2 / std::fabs(value);
  }
}

// Of n intervals at 95 % fewer than this many inside has a chance of 0.1 % (normal bound of the binomial); those of one run hang together:
// twice the variance is allowed for.
int fewest(int n) { return int(n * 0.95 - 3.1 * std::sqrt(2 * n * 0.95 * 0.05)) - 1; }

bool full() { return std::getenv("DRIVEID_FULL") != nullptr; }

void coverage(const records::Drive &drive, double quantum_rad, const char *name) {
  std::map<std::string, Tally> tally;
  const int runs = full() ? 200 : 10;
  for (int seed = 1; seed <= runs; seed++) {
    std::vector<records::Record> training{records::closed_loop(drive, 12, 2e-3, uint32_t(seed))};
    if (quantum_rad > 0)
      for (double &v : training[0].column["theta_rad"]) v = std::round(v / quantum_rad) * quantum_rad;
    count(tally, fit(kModel, training), {{"J_kgm2", drive.J}, {"B_Nms_rad", drive.B}, {"tau_c_Nm", drive.tau_c}, {"tau_0_Nm", drive.tau_0}});
  }
  int inside = 0, all = 0;
  for (const auto &[p, t] : tally) {
    std::printf("| %s | %s | %d of %d | %.2g %% |\n", name, p.c_str(), t.inside, t.all, 100 * t.width / t.all);
    inside += t.inside;
    all += t.all;
  }
  EXPECT_GE(inside, fewest(all)) << name;
}

}  // namespace

TEST(Fit, intervals_cover_with_angle_noise) { coverage({}, 0, "angle noise 20 urad"); }

TEST(Fit, intervals_cover_with_noise_on_the_current_reading) {
  records::Drive d;
  d.angle_noise = 2e-4;
  d.reading_noise = 0.02;
  coverage(d, 0, "angle noise 200 urad, current noise 20 mA");
}

TEST(Fit, intervals_cover_with_a_quantised_encoder) {
  records::Drive d;
  d.angle_noise = 1e-6;
  coverage(d, 6e-4, "encoder of 10,500 counts");
}
