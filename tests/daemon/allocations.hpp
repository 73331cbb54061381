// SPDX-License-Identifier: Apache-2.0
// Every allocation of the test program is counted. In a file of its own: where the operators are inlined the compiler takes malloc and delete for a mismatch.
#pragma once
#include <cstddef>

size_t allocations();
