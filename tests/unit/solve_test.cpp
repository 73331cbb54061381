// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

extern "C" {
#include "base/solve.h"
}

namespace {

TEST(Solve, InverseTimesMatrixIsOneAtAnyScale) {
    std::mt19937_64 g(1);
    std::normal_distribution<double> normal;
    for (int n = 1; n <= 12; n++) {
        std::vector<double> a(n * n), inverse(n * n), pivot(n), scale(n);
        for (auto &s : scale) s = std::exp(6 * normal(g));
        for (int row = 0; row < 3 * n + 3; row++) {
            std::vector<double> x(n);
            for (int i = 0; i < n; i++) x[i] = scale[i] * normal(g);
            for (int i = 0; i < n; i++)
                for (int j = 0; j < n; j++) a[i * n + j] += x[i] * x[j];
        }
        ASSERT_EQ(driveid_solve_inverse(a.data(), n, 1e-12, inverse.data(), pivot.data()), n);
        for (int i = 0; i < n; i++)
            for (int j = 0; j < n; j++) {
                double sum = 0;
                for (int k = 0; k < n; k++) sum += a[i * n + k] * inverse[k * n + j];
                EXPECT_NEAR(sum * scale[j] / scale[i], i == j, 1e-9) << n << ' ' << i << ' ' << j;
            }
    }
}

TEST(Solve, RankCountsWhatCanBeToldApart) {
    // columns: x, 2x, y, 0
    const double a[16] = {5, 10, 1, 0, 10, 20, 2, 0, 1, 2, 7, 0, 0, 0, 0, 0};
    double inverse[16], pivot[4];
    EXPECT_EQ(driveid_solve_inverse(a, 4, 1e-12, inverse, pivot), 2);
    EXPECT_TRUE((pivot[0] > 0) != (pivot[1] > 0));
    EXPECT_GT(pivot[2], 0.9);
    EXPECT_EQ(pivot[3], 0);
    for (double x : inverse) EXPECT_TRUE(std::isfinite(x));
}

} // namespace
