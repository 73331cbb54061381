// SPDX-License-Identifier: Apache-2.0
// Coverage of the stated 95 % intervals, a reduced number of runs: docs/intervals.md has 2,000 a cell (tools/bench: driveid-intervals).
#include <gtest/gtest.h>

#include "intervals.hpp"

namespace {

// 60 runs of a cell that covers 92 % or more give 48 or fewer with a chance below 0.1 % (binomial); an interval that is
// 30 % too narrow (covers 83 %) fails in more than a third of the cells, one of half the width (67 %) in all.
TEST(Intervals, Cover) {
    for (int c = 0; c < intervals::cells; c++) {
        intervals::Result r;
        for (int seed = 1; seed <= 60; seed++) intervals::run(intervals::Cell(c), seed, r);
        EXPECT_EQ(r.answered, r.runs) << intervals::name(intervals::Cell(c));
        for (int i = 0; i < 2; i++) EXPECT_GT(r.covered[i], 48) << intervals::name(intervals::Cell(c)) << (i ? " B" : " J");
        if (c != intervals::white) continue;
        EXPECT_LT(intervals::median(r.ratio[0]), 1.3); // of the Cramer-Rao bound
        EXPECT_LT(intervals::median(r.ratio[1]), 1.3);
    }
}

} // namespace
