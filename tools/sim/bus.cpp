// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <stdexcept>

#include "player.hpp"

namespace sim {
namespace {

// Bytes of a frame as the kernel carries them; returns their number.
std::size_t kernel_frame(const Frame &f, canfd_frame &out) {
    std::memset(&out, 0, sizeof out);
    out.can_id = f.id | (f.id > CAN_SFF_MASK ? CAN_EFF_FLAG : 0u);
    out.len = f.length;
    if (f.fd) out.flags = CANFD_BRS;
    std::memcpy(out.data, f.data, f.length);
    return f.fd ? CANFD_MTU : CAN_MTU;
}

class CanBus : public Bus {
public:
    explicit CanBus(const std::string &interface) {
        fd_ = socket(PF_CAN, SOCK_RAW, CAN_RAW);
        if (fd_ < 0) throw std::runtime_error(std::string("no CAN in this kernel (") + std::strerror(errno) + "): load can-raw, run inside tools/vcan, or use --bus modbus:127.0.0.1:1502");
        const unsigned index = if_nametoindex(interface.c_str());
        if (index == 0) { close(fd_); throw std::runtime_error("no interface " + interface + ": ip link add " + interface + " type vcan; ip link set " + interface + " mtu 72 up"); }
        const int on = 1;
        setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on);
        setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_FILTER, nullptr, 0);  // sends only
        sockaddr_can address{};
        address.can_family = AF_CAN;
        address.can_ifindex = static_cast<int>(index);
        if (bind(fd_, reinterpret_cast<sockaddr *>(&address), sizeof address) != 0) { close(fd_); throw std::runtime_error("cannot bind " + interface + ": " + std::strerror(errno)); }
    }
    ~CanBus() override { close(fd_); }
    bool send(const std::vector<Frame> &frames, const Reading &, std::uint32_t) override {
        bool all = true;
        for (const auto &f : frames) {
            canfd_frame out;
            const std::size_t size = kernel_frame(f, out);
            int tries = 0;
            while (write(fd_, &out, size) < 0) {
                if (errno != ENOBUFS || ++tries > 20) { all = false; break; }  // queue full: wait for the wire; interface down: go on
                usleep(200);
            }
        }
        return all;
    }

private:
    int fd_;
};

// A datagram socket inherited from the parent: {can_frame or canfd_frame, int64 stamp}.
class InheritedBus : public Bus {
public:
    explicit InheritedBus(int fd) : fd_(fd) {
        int type = 0;
        socklen_t size = sizeof type;
        if (getsockopt(fd, SOL_SOCKET, SO_TYPE, &type, &size) != 0) throw std::runtime_error("--bus fd:" + std::to_string(fd) + " is no socket: the parent passes a datagram or seqpacket socketpair");
    }
    bool send(const std::vector<Frame> &frames, const Reading &, std::uint32_t) override {
        for (const auto &f : frames) {
            unsigned char packet[sizeof(canfd_frame) + sizeof(std::int64_t)];
            canfd_frame out;
            const std::size_t size = kernel_frame(f, out);
            std::memcpy(packet, &out, size);
            std::memcpy(packet + size, &f.t_ns, sizeof f.t_ns);
            if (::send(fd_, packet, size + sizeof f.t_ns, MSG_NOSIGNAL) < 0) return false;
        }
        return true;
    }

private:
    int fd_;
};

class LogBus : public Bus {
public:
    LogBus(const std::string &file, std::string interface) : interface_(std::move(interface)), file_(std::fopen(file.c_str(), "w")) {
        if (!file_) throw std::runtime_error("cannot write " + file + ": " + std::strerror(errno));
    }
    ~LogBus() override { std::fclose(file_); }
    bool send(const std::vector<Frame> &frames, const Reading &, std::uint32_t) override {
        for (const auto &f : frames) if (std::fputs(candump_line(f, interface_).c_str(), file_) < 0) throw std::runtime_error("candump log: disk full");
        return true;
    }
    bool real_time() const override { return false; }

private:
    std::string interface_;
    std::FILE *file_;
};

}  // namespace

std::unique_ptr<Bus> open_bus(const PlayRequest &q, const Setup &setup) {
    const auto colon = q.bus.find(':');
    const std::string kind = q.bus.substr(0, colon), rest = colon == std::string::npos ? "" : q.bus.substr(colon + 1);
    if (rest.empty()) throw std::runtime_error("--bus " + q.bus + ": give can:IFACE, modbus:HOST:PORT, fd:N or log:FILE.log");
    if (kind == "can") return std::make_unique<CanBus>(rest);
    if (kind == "log") return std::make_unique<LogBus>(rest, "vcan0");
    if (kind == "fd") return std::make_unique<InheritedBus>(std::stoi(rest));
    if (kind == "modbus") {
        const auto port = rest.rfind(':');
        if (port == std::string::npos) throw std::runtime_error("--bus " + q.bus + ": the port is missing (modbus:127.0.0.1:1502)");
        return open_modbus(rest.substr(0, port), std::stoi(rest.substr(port + 1)), setup);
    }
    throw std::runtime_error("--bus " + q.bus + ": unknown kind '" + kind + "'; can, modbus, fd or log");
}

}  // namespace sim
