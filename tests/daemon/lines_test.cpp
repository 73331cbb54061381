// SPDX-License-Identifier: Apache-2.0
// Lines of candump and slcan, and the queue of lines to a subscriber.
#include <deque>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "control/line_queue.hpp"
#include "record/candump.hpp"
#include "record/slcan.hpp"

using namespace gw;

namespace {

TEST(Candump, ReadsEachKindOfFrame) {
    CandumpLine l;
    ASSERT_TRUE(candump_parse("(1436509052.249713) vcan0 044#2A366C2BBA", l));
    EXPECT_EQ(l.t_ns, 1436509052249713000);
    EXPECT_EQ(l.interface, "vcan0");
    EXPECT_EQ(l.frame.can_id, 0x44u);
    EXPECT_EQ(l.frame.len, 5);
    EXPECT_EQ(l.frame.data[4], 0xBA);
    EXPECT_FALSE(l.fd);
    ASSERT_TRUE(candump_parse("(0.1) can1 18FF1234#", l));
    EXPECT_EQ(l.frame.can_id, 0x18FF1234u | CAN_EFF_FLAG);
    EXPECT_EQ(l.t_ns, 100000000);
    ASSERT_TRUE(candump_parse("(1.000000001) can0 123##5112233445566778899AABBCC", l));
    EXPECT_TRUE(l.fd);
    EXPECT_EQ(l.frame.flags, 5);
    EXPECT_EQ(l.frame.len, 12);
    EXPECT_EQ(l.t_ns, 1000000001);
    ASSERT_TRUE(candump_parse("(1.0) can0 123#R4 R", l));
    EXPECT_EQ(l.frame.can_id, 0x123u | CAN_RTR_FLAG);
    EXPECT_EQ(l.frame.len, 4);
    ASSERT_TRUE(candump_parse("(1.0) can0 20000040#0000000000000000", l));
    EXPECT_EQ(l.frame.can_id, 0x20000040u);
}

TEST(Candump, RefusesWhatIsNoFrame) {
    CandumpLine l;
    for (const char* bad : {"", "x", "(1.0) can0", "(1.0) can0 123", "(1.0) can0 12#00", "(1.0) can0 1234#00", "(1.0) can0 800#00", "(1.0) can0 123#0", "(1.0) can0 123#0G",
                            "(1.0) can0 123#001122334455667788", "(1.0) can0 123##1112233445566778899", "(1.0) can0 123##", "(1.0) can0 123#R9", "1.0 can0 123#00",
                            "(1) can0 123#00", "(.5) can0 123#00", "(1.) can0 123#00", "(1.1234567890) can0 123#00", "(99999999999999999999.0) can0 123#00", "(-1.0) can0 123#00",
                            "(1.0) can0 FFFFFFFF#00"})
        EXPECT_FALSE(candump_parse(bad, l)) << bad;
}

TEST(SlcanLine, ReadsAndWrites) {
    canfd_frame f;
    ASSERT_EQ(slcan_parse("t1232AABB", f), Slcan::frame);
    EXPECT_EQ(f.can_id, 0x123u);
    EXPECT_EQ(f.len, 2);
    EXPECT_EQ(f.data[1], 0xBB);
    ASSERT_EQ(slcan_parse("T12ABCDEF80011223344556677", f), Slcan::frame);
    EXPECT_EQ(f.can_id, 0x12ABCDEFu | CAN_EFF_FLAG);
    EXPECT_EQ(slcan_parse("t12310A1B2", f), Slcan::broken);         // a stamp has four digits
    EXPECT_EQ(slcan_parse("t123100A1B2", f), Slcan::frame);         // with a time stamp
    ASSERT_EQ(slcan_parse("r1234", f), Slcan::frame);
    EXPECT_EQ(f.can_id, 0x123u | CAN_RTR_FLAG);
    EXPECT_EQ(slcan_parse("z", f), Slcan::other);
    EXPECT_EQ(slcan_parse("", f), Slcan::other);
    for (const char* bad : {"t", "t12", "t123", "t1239", "t8000", "tXYZ0", "t1231", "t1231G0", "TFFFFFFFF0", "q", "\xff\xfe"}) EXPECT_EQ(slcan_parse(bad, f), Slcan::broken) << bad;
    canfd_frame g{};
    g.can_id = 0x5A0, g.len = 3, g.data[0] = 1, g.data[1] = 0xFF, g.data[2] = 0x10;
    char line[32];
    EXPECT_EQ(std::string(line, slcan_print(g, line)), "t5A0301FF10\r");
    g.can_id = 0x18FF0001 | CAN_EFF_FLAG;
    EXPECT_EQ(std::string(line, slcan_print(g, line)), "T18FF0001301FF10\r");
}

std::string take(LineQueue& q, size_t at_most) {
    const auto part = q.front().substr(0, at_most);
    std::string out(part);
    if (!out.empty()) q.sent(out.size());
    return out;
}

TEST(LineQueue, LosesTheOldestWholeLinesAndCounts) {
    LineQueue q(100);
    for (int k = 0; k < 10; ++k) ASSERT_TRUE(q.push("line " + std::to_string(k) + " of ten...\n"));  // 22 bytes with its length
    EXPECT_EQ(q.lost(), 6u);
    std::string all;
    while (!q.empty()) all += take(q, 1000);
    EXPECT_EQ(all, "line 6 of ten...\nline 7 of ten...\nline 8 of ten...\nline 9 of ten...\n");
    EXPECT_FALSE(q.push(std::string(200, 'x')));
    EXPECT_EQ(q.take_lost(), 7u);
    EXPECT_EQ(q.take_lost(), 0u);
}

TEST(LineQueue, WhatIsReadIsWholeLinesInOrderWhateverTheChunks) {
    std::mt19937 random(3);
    for (int trial = 0; trial < 200; ++trial) {
        LineQueue q(64 + random() % 500);
        std::string read;
        uint64_t next = 0;
        for (int k = 0; k < 500; ++k) {
            if (random() % 2) q.push(std::to_string(next++) + std::string(random() % 30, '.') + "\n");
            else read += take(q, 1 + random() % 40);
        }
        while (!q.empty()) read += take(q, 1000);
        uint64_t seen = 0, lines = 0;
        int64_t last = -1;
        for (size_t at = 0; at < read.size(); ++lines) {
            const size_t end = read.find('\n', at);
            ASSERT_NE(end, std::string::npos);
            const int64_t number = std::stoll(read.substr(at, end - at));
            ASSERT_GT(number, last);
            last = number;
            ++seen;
            at = end + 1;
        }
        ASSERT_EQ(seen + q.lost(), next) << "read and lost are all there were";
    }
}

}  // namespace
