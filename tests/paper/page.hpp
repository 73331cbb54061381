// SPDX-License-Identifier: Apache-2.0
// A number of a paper: asserted against what a correct implementation reaches, and written to the file that DRIVEID_PAPERS names, out of which
// docs/papers.py makes docs/papers.md. So what the page shows is what the tests measured.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>

namespace page {

constexpr double none = NAN;  // nothing was printed, or it is lost

// One table (or claim) of a paper; why: what makes ours differ from the printed numbers, "" where nothing does.
class Table {
public:
    Table(std::string paper, std::string title, std::string why) : head_(paper + "\t" + title + "\t" + why) {}

    // ours lies within slack of reachable.
    void near(const std::string &entry, double printed, double ours, double reachable, double slack) const {
        EXPECT_NEAR(ours, reachable, slack) << head_ << ": " << entry;
        write(entry, printed, ours, reachable, slack, "near");
    }
    // ours is an error, at most bound.
    void below(const std::string &entry, double printed, double ours, double bound) const {
        EXPECT_LE(ours, bound) << head_ << ": " << entry;
        write(entry, printed, ours, bound, bound, "below");
    }

private:
    void write(const std::string &entry, double printed, double ours, double reachable, double slack, const char *kind) const {
        const char *name = std::getenv("DRIVEID_PAPERS");
        if (!name) return;
        std::FILE *file = std::fopen(name, "a");
        ASSERT_NE(file, nullptr) << name;
        std::fprintf(file, "%s\t%s\t%.9g\t%.9g\t%.9g\t%.9g\t%s\n", head_.c_str(), entry.c_str(), printed, ours, reachable, slack, kind);
        std::fclose(file);
    }
    std::string head_;
};

inline std::string join(const char *format, double a, double b = 0) {
    char text[80];
    std::snprintf(text, sizeof text, format, a, b);
    return text;
}

}  // namespace page
