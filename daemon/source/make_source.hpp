// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <memory>

#include "base/loop.hpp"
#include "source/source.hpp"

namespace gw {

std::unique_ptr<Source> make_source(const Config& config, int index, Consumer& consumer, Loop& loop);

}  // namespace gw
