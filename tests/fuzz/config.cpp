// SPDX-License-Identifier: Apache-2.0
// Any text as configuration: it is refused with a message, or its drives can be built or are refused with a message.
#include "fuzz.hpp"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    static Nobody nobody;
    const gw::ConfigResult r = gw::config_read_text(std::string(text_of(data, size)), "x.toml");
    for (const auto& e : r.errors) HOLDS(e.starts_with("x.toml:"));
    if (!r.errors.empty()) return 0;
    for (const auto& d : r.config.drives)
        if (!d.model.empty()) return 0;  // reads files
    std::vector<std::string> errors;
    const auto drives = gw::build_drives(r.config, nobody, errors);
    HOLDS(drives.size() + errors.size() == r.config.drives.size());
    return 0;
}
