// SPDX-License-Identifier: Apache-2.0
// The watchdog's pulse comes from the data path: frames that wait unread starve it, whatever else the loop does.
#include <gtest/gtest.h>

#include <sys/socket.h>
#include <unistd.h>

#include "base/loop.hpp"
#include "gateway.hpp"

namespace {

TEST(Pulse, WaitingFramesThatNobodyReadsStarveTheWatchdog) {
    int pair[2];
    ASSERT_EQ(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, pair), 0);
    const gw::ConfigResult r = gw::config_read_text(
        "format = 1\n[[source]]\nname = \"bus\"\nkind = \"socketpair\"\ndescriptor = " + std::to_string(pair[1]) +
        "\n[[drive]]\nname = \"a\"\nstructure = \"rigid_axis\"\ngiven = { K_t_Nm_A = 0.05 }\ndt_s = 0.001\n"
        "  [[drive.signal]]\n  name = \"i_A\"\n  source = \"bus\"\n  can_id = 0x181\n"
        "  [[drive.signal]]\n  name = \"theta_rad\"\n  source = \"bus\"\n  can_id = 0x181\n  start_bit = 16\n  length = 32\n  counts_per_turn = 4096\n", "x.toml");
    ASSERT_TRUE(r.errors.empty()) << r.errors[0];
    gw::Loop loop;
    gw::Gateway gateway(r.config, loop, nullptr);
    gateway.start();
    EXPECT_TRUE(gateway.alive()) << "a quiet bus";
    struct { can_frame frame; int64_t stamp; } message{};
    message.frame.can_id = 0x181, message.frame.can_dlc = 8, message.stamp = 1;
    ASSERT_EQ(send(pair[0], &message, sizeof message, 0), ssize_t(sizeof message));
    EXPECT_FALSE(gateway.alive()) << "a frame waits, the data path does not take it";
    EXPECT_FALSE(gateway.alive());
    gw::Timer stop(loop, [&] { loop.stop(); });
    stop.start(20000000, 0);
    loop.run();
    EXPECT_TRUE(gateway.alive()) << "it was taken";
    EXPECT_TRUE(gateway.alive());
    close(pair[0]);
}

}  // namespace
