// SPDX-License-Identifier: Apache-2.0
// Any bytes as state file, and any JSON inside a valid one.
#include <cmath>

#include "fuzz.hpp"
#include "system/state.hpp"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    static Nobody nobody;
    static const gw::Config config = gw::config_read_text(kFuzzConfig, "x").config;
    std::string_view json;
    if (gw::state_open(text_of(data, size), json)) HOLDS(json.size() < size);
    static std::vector<std::string> errors;
    static auto drives = gw::build_drives(config, nobody, errors);
    for (auto& d : drives)
        for (auto& p : d->parameters()) p.known = false;
    int restored = 0;
    gw::state_apply(text_of(data, size), drives, 2000000000, 1000000000, restored);
    for (auto& d : drives)
        for (auto& p : d->parameters()) HOLDS(!p.known || (std::isfinite(p.value) && p.lo <= p.hi && !p.trusted && p.restored_age_s >= 0));
    return 0;
}
