// SPDX-License-Identifier: Apache-2.0
#include "source/can_stamp.hpp"

#include <cstring>
#include <ctime>  // linux/errqueue.h wants timespec
#include <linux/errqueue.h>

namespace gw {

void CanStamps::read(const msghdr& header, driveid_stamp& stamp, uint64_t& dropped) {
    stamp = {realtime_.now_ns(), 10000000, DRIVEID_CLOCK_DAEMON};
    for (cmsghdr* c = CMSG_FIRSTHDR(&header); c; c = CMSG_NXTHDR(const_cast<msghdr*>(&header), c)) {
        if (c->cmsg_level != SOL_SOCKET) continue;
        if (c->cmsg_type == SO_TIMESTAMPING) {
            scm_timestamping ts;
            memcpy(&ts, CMSG_DATA(c), sizeof ts);
            const MonotonicStamp soft = realtime_.convert(to_ns({ts.ts[0].tv_sec, ts.ts[0].tv_nsec}));
            const int64_t hard = to_ns({ts.ts[2].tv_sec, ts.ts[2].tv_nsec});
            hardware_ = hard != 0;
            const MonotonicStamp s = hard ? hardware_clock_.convert(hard, soft.t_ns) : soft;
            stamp = {s.t_ns, s.err_ns, hard ? DRIVEID_CLOCK_HARDWARE : DRIVEID_CLOCK_KERNEL};
        } else if (c->cmsg_type == SO_RXQ_OVFL) {
            uint32_t total;
            memcpy(&total, CMSG_DATA(c), sizeof total);
            dropped += uint32_t(total - overflow_);  // wraps as the kernel's counter does
            overflow_ = total;
        }
    }
}

}  // namespace gw
