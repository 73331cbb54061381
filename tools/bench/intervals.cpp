// SPDX-License-Identifier: Apache-2.0
// The table of docs/intervals.md: coverage of the stated 95 % intervals, 2,000 known-truth runs a cell. Usage: driveid-intervals [runs]
#include <cstdio>
#include <cstdlib>

#include "intervals.hpp"

int main(int argc, char **argv) {
    const int runs = argc > 1 ? std::atoi(argv[1]) : 2000;
    std::printf("| cell | runs | answered | J covered %% | B covered %% | J median half-width / 1.96, %% | B | J over Cramer-Rao | B over Cramer-Rao |\n");
    std::printf("|---|---|---|---|---|---|---|---|---|\n");
    for (int c = 0; c < intervals::cells; c++) {
        intervals::Result r;
        for (int seed = 1; seed <= runs; seed++) intervals::run(intervals::Cell(c), seed, r);
        const double n = r.answered ? r.answered : 1;
        std::printf("| %s | %d | %d | %.1f | %.1f | %.4f | %.4f |", intervals::name(intervals::Cell(c)), r.runs, r.answered, 100 * r.covered[0] / n,
                    100 * r.covered[1] / n, 100 * intervals::median(r.width[0]), 100 * intervals::median(r.width[1]));
        if (c == intervals::white || c == intervals::rests) std::printf(" %.2f | %.2f |\n", intervals::median(r.ratio[0]), intervals::median(r.ratio[1]));
        else std::printf(" - | - |\n");
        std::fflush(stdout);
    }
    return 0;
}
