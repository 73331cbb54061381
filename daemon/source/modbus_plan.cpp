// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "drive/field.hpp"
#include "source/modbus_master.hpp"

namespace gw {

std::vector<RegisterBlock> plan_reads(const Config& config, const SourceConfig& source) {
    std::vector<RegisterBlock> wanted, plan;
    const auto want = [&](const FieldConfig& c) {
        if (c.source != source.name || c.address < 0) return;
        const RegisterField f(c);
        wanted.push_back({f.holding, f.address, f.count});
    };
    for (const auto& d : config.drives) {
        for (const auto& s : d.signals) want(s);
        if (d.has_counter) want(d.counter);
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
