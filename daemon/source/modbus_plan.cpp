// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "drive/field.hpp"
#include "source/modbus_master.hpp"

namespace gw {

std::vector<RegisterBlock> plan_reads(const Config& config, const SourceConfig& source) {
    std::vector<RegisterBlock> wanted, plan;
    for (const auto& d : config.drives)
        for (const auto& s : d.signals)
            if (s.source == source.name && s.address >= 0) {
                const RegisterField f(s);
                wanted.push_back({f.holding, f.address, f.count});
            }
    std::sort(wanted.begin(), wanted.end(), [](auto& a, auto& b) { return std::pair(a.holding, a.address) < std::pair(b.holding, b.address); });
    for (const auto& w : wanted) {
        RegisterBlock* last = plan.empty() ? nullptr : &plan.back();
        const int end = last ? last->address + last->count : 0;
        const int new_end = std::max(end, w.address + w.count);
        if (last && last->holding == w.holding && w.address <= end + source.merge_gap && new_end - last->address <= 125) last->count = uint16_t(new_end - last->address);
        else plan.push_back(w);
    }
    return plan;
}

}  // namespace gw
