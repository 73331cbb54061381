// SPDX-License-Identifier: Apache-2.0
#include "source/make_source.hpp"

#include <stdexcept>

#include "drive/field.hpp"
#include "source/can_source.hpp"
#include "source/modbus_master.hpp"
#include "source/replay.hpp"

namespace gw {

namespace {

// What the kernel need hand over: the frames that some drive reads.
std::vector<can_filter> filters_of(const Config& config, const std::string& source) {
    std::vector<can_filter> filters;
    const auto add = [&](const FieldConfig& f) {
        if (f.source != source || f.address >= 0) return;
        const CanField field(f);
        const canid_t flag = field.extended ? CAN_EFF_FLAG : 0;
        const can_filter filter{field.can_id | flag, field.mask | CAN_EFF_FLAG | CAN_RTR_FLAG};
        for (const auto& known : filters)
            if (known.can_id == filter.can_id && known.can_mask == filter.can_mask) return;
        filters.push_back(filter);
    };
    for (const auto& d : config.drives) {
        for (const auto& s : d.signals) add(s);
        if (d.has_counter) add(d.counter);
        if (d.instant_can_id >= 0) filters.push_back({canid_t(d.instant_can_id), CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG});
    }
    return filters;
}

}  // namespace

std::unique_ptr<Source> make_source(const Config& config, int index, Consumer& consumer, Loop& loop) {
    const SourceConfig& c = config.sources[size_t(index)];
    if (c.kind == "socketcan") return std::make_unique<CanSource>(c, index, consumer, loop, make_socketcan_port(c, filters_of(config, c.name)));
    if (c.kind == "socketpair") return std::make_unique<CanSource>(c, index, consumer, loop, make_socketpair_port(c));
    if (c.kind == "slcan") return std::make_unique<CanSource>(c, index, consumer, loop, make_slcan_port(c));
    if (c.kind == "replay") return std::make_unique<ReplaySource>(c, index, consumer, config_path(config, c.file));
    return make_modbus_master(config, index, consumer, loop);
}

}  // namespace gw
