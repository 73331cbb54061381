// SPDX-License-Identifier: Apache-2.0
// The unit checks of tests/target/checks.c on this machine; test_target.py runs the same file on Cortex-M.
#include <gtest/gtest.h>

#include <string>
#include <tuple>

#include "checks.h"

class Portable : public testing::TestWithParam<std::tuple<const char *, driveid_real>> {};

TEST_P(Portable, EveryCheckHolds) {
    const auto [method, type] = GetParam();
    for (unsigned i = 0; checks_name(i); i++) EXPECT_EQ(checks_run(i, method, type), 0) << checks_name(i) << ": the line of tests/target/checks.c";
}

INSTANTIATE_TEST_SUITE_P(Methods, Portable, testing::Combine(testing::Values("fsm", "rls", "window", "discrete"), testing::Values(DRIVEID_F64, DRIVEID_F32, DRIVEID_Q31)),
                         [](const auto &one) { return std::string(std::get<0>(one.param)) + (std::get<1>(one.param) == DRIVEID_F64 ? "F64" : std::get<1>(one.param) == DRIVEID_F32 ? "F32" : "Q31"); });
