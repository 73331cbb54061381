// SPDX-License-Identifier: Apache-2.0
// The watchdog's pulse comes from the data path: frames that wait unread starve it, whatever else the loop does.
#include <gtest/gtest.h>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <thread>
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

// Answers every read of n registers with zeros until the peer is gone.
void serve(int listener) {
    const int fd = accept(listener, nullptr, nullptr);
    uint8_t q[12];
    while (recv(fd, q, sizeof q, MSG_WAITALL) == ssize_t(sizeof q)) {
        uint8_t a[9 + 250] = {q[0], q[1], 0, 0, 0, uint8_t(3 + 2 * q[11]), q[6], q[7], uint8_t(2 * q[11])};
        if (send(fd, a, size_t(9 + 2 * q[11]), MSG_NOSIGNAL) < 0) break;
    }
    close(fd);
}

TEST(Pulse, RepliesThatNobodyTakesStarveTheWatchdog) {
    const int listener = socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof at;
    ASSERT_EQ(bind(listener, reinterpret_cast<sockaddr*>(&at), size), 0);
    ASSERT_EQ(listen(listener, 1), 0);
    ASSERT_EQ(getsockname(listener, reinterpret_cast<sockaddr*>(&at), &size), 0);
    std::thread server(serve, listener);
    {
        const gw::ConfigResult r = gw::config_read_text(
            "format = 1\n[[source]]\nname = \"plc\"\nkind = \"modbus_tcp\"\nhost = \"127.0.0.1\"\nport = " + std::to_string(ntohs(at.sin_port)) +
            "\nunit = 1\npoll_s = 0.0005\n[[drive]]\nname = \"a\"\nstructure = \"rigid_axis\"\ngiven = { K_t_Nm_A = 0.05 }\ndt_s = 0.005\n"
            "  [[drive.signal]]\n  name = \"i_A\"\n  source = \"plc\"\n  address = 0\n  [[drive.signal]]\n  name = \"omega_rad_s\"\n  source = \"plc\"\n  address = 1\n", "x.toml");
        ASSERT_TRUE(r.errors.empty()) << r.errors[0];
        gw::Loop loop;
        gw::Gateway gateway(r.config, loop, nullptr);
        EXPECT_TRUE(gateway.alive()) << "nothing is polled yet";
        gateway.start();
        bool starved = false;
        for (int k = 0; k < 500 && !starved; ++k) {
            usleep(10000);
            starved = !gateway.alive();
        }
        EXPECT_TRUE(starved) << "replies wait, the data path does not take them";
        gw::Timer stop(loop, [&] { loop.stop(); });
        stop.start(50000000, 0);
        loop.run();
        EXPECT_TRUE(gateway.alive()) << "they were taken";
        for (int k = 0; k < 40 && gateway.sources()[0]->status().dropped == 0; ++k) {  // until there is no more room for what waits
            usleep(500000);
            stop.start(50000000, 0);
            loop.run();
        }
        EXPECT_GT(gateway.sources()[0]->status().dropped, 0u) << "counted, not kept";
        EXPECT_EQ(gateway.drives()[0]->counters().dropped, gateway.sources()[0]->status().dropped);
        EXPECT_GT(gateway.drives()[0]->counters().gaps, 0u);
    }
    server.join();
    close(listener);
}

}  // namespace
