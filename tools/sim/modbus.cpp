// SPDX-License-Identifier: Apache-2.0
// The drive as a Modbus TCP server: its last sample in input registers, all of one instant.
#include <modbus.h>
#include <poll.h>
#include <unistd.h>

#include <atomic>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <mutex>
#include <stdexcept>
#include <thread>

#include "player.hpp"

namespace sim {
namespace {

struct Register { const char *signal; int address; const char *encoding; double Reading::*value; };

// Two registers each, high word first.
constexpr Register REGISTERS[] = {
    {"counter", 0, "u32", nullptr},     {"position", 2, "i32", &Reading::q},   {"current", 4, "f32", &Reading::i},
    {"i_d_A", 6, "f32", &Reading::i_d}, {"voltage", 8, "f32", &Reading::v},    {"v_d_V", 10, "f32", &Reading::v_d},
    {"speed", 12, "f32", &Reading::w},  {"torque", 14, "f32", &Reading::torque}, {"T_degC", 16, "f32", &Reading::T},
};
constexpr int REGISTER_COUNT = 18;

std::string signal_name(const Register &r, const Drive &d) {
    const std::string name = r.signal;
    const bool dc = d.structure.rfind("dc_", 0) == 0 || d.linear;
    if (name == "position") return d.linear ? "x_m" : "theta_rad";
    if (name == "current") return dc ? "i_A" : "i_q_A";
    if (name == "voltage") return d.pmsm ? "v_q_V" : "v_V";
    if (name == "speed") return d.linear ? "v_m_s" : "omega_rad_s";
    if (name == "torque") return d.linear ? "F_N" : "tau_Nm";
    return name;
}

class ModbusBus : public Bus {
public:
    ModbusBus(const std::string &host, int port, const Setup &setup)
        : count_(setup.drive.linear ? 1 / setup.drive.counts : 2 * M_PI / setup.drive.counts) {
        context_ = modbus_new_tcp(host.c_str(), port);
        map_ = modbus_mapping_new(0, 0, 0, REGISTER_COUNT);
        listener_ = context_ && map_ ? modbus_tcp_listen(context_, 8) : -1;
        if (listener_ < 0) {
            const std::string why = modbus_strerror(errno);
            release();
            throw std::runtime_error("cannot serve Modbus on " + host + ":" + std::to_string(port) + ": " + why + "; choose a free port above 1023");
        }
        server_ = std::thread([this] { serve(); });
    }
    ~ModbusBus() override {
        stop_ = true;
        server_.join();
        close(listener_);
        release();
    }
    bool send(const std::vector<Frame> &, const Reading &reading, std::uint32_t counter) override {
        const std::lock_guard<std::mutex> lock(mutex_);
        for (const auto &r : REGISTERS) {
            std::uint32_t word = counter;
            if (r.value && r.encoding[0] == 'f') word = std::bit_cast<std::uint32_t>(static_cast<float>(reading.*r.value));
            else if (r.value) word = static_cast<std::uint32_t>(static_cast<std::int64_t>(std::llround(reading.*r.value / count_)));
            map_->tab_input_registers[r.address] = static_cast<std::uint16_t>(word >> 16);
            map_->tab_input_registers[r.address + 1] = static_cast<std::uint16_t>(word);
        }
        return true;
    }

private:
    void release() {
        if (map_) modbus_mapping_free(map_);
        if (context_) modbus_free(context_);
    }
    void serve() {
        std::vector<pollfd> peers{{listener_, POLLIN, 0}};
        std::uint8_t query[MODBUS_TCP_MAX_ADU_LENGTH];
        while (!stop_) {
            if (poll(peers.data(), peers.size(), 100) <= 0) continue;
            for (std::size_t n = peers.size(); n-- > 1;) {
                if (!peers[n].revents) continue;
                modbus_set_socket(context_, peers[n].fd);
                const int size = modbus_receive(context_, query);
                bool alive = size >= 0;
                if (size > 0) {
                    const std::lock_guard<std::mutex> lock(mutex_);
                    alive = modbus_reply(context_, query, size, map_) >= 0;
                }
                if (!alive) { close(peers[n].fd); peers.erase(peers.begin() + static_cast<long>(n)); }
            }
            if (peers[0].revents) {
                int listener = listener_;
                const int fd = modbus_tcp_accept(context_, &listener);
                if (fd >= 0 && peers.size() < 9) peers.push_back({fd, POLLIN, 0});
                else if (fd >= 0) close(fd);
            }
        }
        for (std::size_t n = 1; n < peers.size(); ++n) close(peers[n].fd);
        modbus_set_socket(context_, -1);
    }

    modbus_t *context_ = nullptr;
    modbus_mapping_t *map_ = nullptr;
    int listener_ = -1;
    double count_;
    std::atomic<bool> stop_{false};
    std::mutex mutex_;
    std::thread server_;
};

}  // namespace

std::unique_ptr<Bus> open_modbus(const std::string &host, int port, const Setup &setup) { return std::make_unique<ModbusBus>(host, port, setup); }

std::string modbus_config(const Setup &setup, const ConfigOptions &options, const std::string &host, int port) {
    ConfigOptions o = options;
    o.dt_s = std::max(o.dt_s, 0.002);
    char poll_s[24];  // twice a sample, where that is not too fast: every count is seen, those seen twice are told by the counter
    std::snprintf(poll_s, sizeof poll_s, "%.9g", std::max(0.5 * options.dt_s, 0.002));
    std::string out = config_head(o) + "\n[[source]]\nname = \"bus\"\nkind = \"modbus_tcp\"\nhost = \"" + host + "\"\nport = " + std::to_string(port) +
                      "\nunit = 1\npoll_s = " + poll_s + "\ntimeout_s = 0.3\n" + config_drive(o);
    const auto wanted = signals_of(o.structure);
    // A poll is late by the server's and the master's whims; the counter tells which sample it saw.
    out += "paced = true\ngap_s = 0.1\ncount_s = " + std::to_string(options.dt_s) + "\n\n  [drive.counter]\n  source = \"bus\"\n  table = \"input\"\n  address = 0\n  encoding = \"u32\"\n";
    for (const auto &r : REGISTERS) {
        const std::string name = signal_name(r, setup.drive);
        if (name == "tau_Nm" || name == "F_N") continue;  // the current tells the same
        bool use = false;
        for (const auto &w : wanted) use = use || w == name;
        if (!use) continue;
        out += "\n  [[drive.signal]]\n  name = \"" + name + "\"\n  source = \"bus\"\n  table = \"input\"\n  address = " + std::to_string(r.address) +
               "\n  registers = 2\n  encoding = \"" + r.encoding + "\"\n  word_order = \"big\"\n";
        const bool mean = setup.sensors.average && (std::string(r.signal) == "current" || name == "i_d_A");
        out += std::string("  hold = \"") + (mean || (name[0] == 'v' && name != "v_m_s") ? "average" : "instant") + "\"\n";
        char number[48];
        if (std::string(r.signal) == "position") {
            std::snprintf(number, sizeof number, setup.drive.linear ? "  scale = %.17g\n" : "  counts_per_turn = %.1f\n", setup.drive.linear ? 1 / setup.drive.counts : setup.drive.counts);
            out += number;
        }
    }
    return out;
}

}  // namespace sim
