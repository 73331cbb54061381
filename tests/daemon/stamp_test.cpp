// SPDX-License-Identifier: Apache-2.0
// Control messages as the kernel writes them, without a kernel: stamps of the controller and of the kernel, losses.
#include <cstring>
#include <ctime>
#include <linux/errqueue.h>
#include <vector>

#include <gtest/gtest.h>

#include "source/can_stamp.hpp"

using namespace gw;

namespace {

struct Header {
    alignas(cmsghdr) char room[512]{};
    msghdr h{};
    Header() { h.msg_control = room, h.msg_controllen = 0; }
    void add(int level, int type, const void* data, size_t size) {
        auto* c = reinterpret_cast<cmsghdr*>(room + h.msg_controllen);
        c->cmsg_level = level, c->cmsg_type = type, c->cmsg_len = CMSG_LEN(size);
        memcpy(CMSG_DATA(c), data, size);
        h.msg_controllen += CMSG_SPACE(size);
    }
    void stamps(int64_t soft_ns, int64_t hard_ns) {
        scm_timestamping ts{};
        ts.ts[0] = {soft_ns / 1000000000, soft_ns % 1000000000};
        ts.ts[2] = {hard_ns / 1000000000, hard_ns % 1000000000};
        add(SOL_SOCKET, SO_TIMESTAMPING, &ts, sizeof ts);
    }
    void lost(uint32_t total) { add(SOL_SOCKET, SO_RXQ_OVFL, &total, sizeof total); }
};

driveid_stamp read(CanStamps& stamps, const Header& header, uint64_t& dropped) {
    driveid_stamp s{};
    stamps.read(header.h, s, dropped);
    return s;
}

TEST(CanStamps, TheKernelsStampIsMadeMonotonic) {
    CanStamps stamps;
    uint64_t dropped = 0;
    stamps.measure();
    Header h;
    h.stamps(clock_ns(CLOCK_REALTIME) - 50000000, 0);
    stamps.measure();
    const driveid_stamp s = read(stamps, h, dropped);
    EXPECT_EQ(s.clock, DRIVEID_CLOCK_KERNEL);
    EXPECT_STREQ(stamps.clock(), "kernel");
    const int64_t age = monotonic_ns() - s.t_ns;
    EXPECT_GE(age, 50000000);
    EXPECT_EQ(dropped, 0u);
}

TEST(CanStamps, TheControllersStampIsPreferredAndSaid) {
    CanStamps stamps;
    uint64_t dropped = 0;
    int64_t before = 0;
    for (int k = 0; k < 5; ++k) {  // exactly 1 ms apart by the controller's clock, whatever the kernel saw
        Header h;
        h.stamps(clock_ns(CLOCK_REALTIME), 77000000000 + k * 1000000);
        stamps.measure();
        const driveid_stamp s = read(stamps, h, dropped);
        EXPECT_EQ(s.clock, DRIVEID_CLOCK_HARDWARE);
        EXPECT_STREQ(stamps.clock(), "hardware");
        if (k) {
            EXPECT_LE(s.t_ns - before, 1000000 + 100) << "no more than the controller says, and its drift";
        }
        before = s.t_ns;
    }
    Header soft;
    soft.stamps(clock_ns(CLOCK_REALTIME), 0);
    stamps.measure();
    EXPECT_EQ(read(stamps, soft, dropped).clock, DRIVEID_CLOCK_KERNEL);
    EXPECT_STREQ(stamps.clock(), "kernel") << "a frame without one says so";
}

TEST(CanStamps, WithoutAStampItIsNowWithAWideBound) {
    CanStamps stamps;
    uint64_t dropped = 0;
    stamps.measure();
    Header h;
    const int other = 1;
    h.add(SOL_SOCKET + 1, SO_TIMESTAMPING, &other, sizeof other);
    h.add(SOL_SOCKET, SO_RXQ_OVFL + 100, &other, sizeof other);
    const driveid_stamp s = read(stamps, h, dropped);
    EXPECT_EQ(s.clock, DRIVEID_CLOCK_DAEMON);
    EXPECT_GE(s.err_ns, 10000000);
    EXPECT_LE(s.t_ns, monotonic_ns());
}

TEST(CanStamps, LossesAreDifferencesOfACounterThatWraps) {
    CanStamps stamps;
    uint64_t dropped = 0;
    const auto lost = [&](uint32_t total) {
        Header h;
        h.stamps(clock_ns(CLOCK_REALTIME), 0);
        h.lost(total);
        read(stamps, h, dropped);
        return dropped;
    };
    stamps.measure();
    EXPECT_EQ(lost(0), 0u);
    EXPECT_EQ(lost(7), 7u);
    EXPECT_EQ(lost(7), 7u);
    EXPECT_EQ(lost(4294967295u), 4294967295u);
    EXPECT_EQ(lost(4), 4294967300u) << "5 more";
    stamps.reopened();
    EXPECT_EQ(lost(2), 4294967302u) << "a new socket counts from 0";
}

}  // namespace
