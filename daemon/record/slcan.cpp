// SPDX-License-Identifier: Apache-2.0
#include "record/slcan.hpp"

#include <cstdint>
#include <cstring>

namespace gw {

namespace {

bool hex(std::string_view s, uint32_t& v) {
    v = 0;
    for (char c : s) {
        const int d = c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
        if (d < 0) return false;
        v = v << 4 | uint32_t(d);
    }
    return true;
}

}  // namespace

Slcan slcan_parse(std::string_view line, canfd_frame& f) {
    if (line.empty()) return Slcan::other;
    const char kind = line[0];
    if (kind == 'z' || kind == 'Z' || kind == 'V' || kind == 'v' || kind == 'N' || kind == 'F') return Slcan::other;
    const bool extended = kind == 'T' || kind == 'R', remote = kind == 'r' || kind == 'R';
    if (kind != 't' && !extended && !remote) return Slcan::broken;
    const size_t digits = extended ? 8 : 3;
    uint32_t id, byte;
    if (line.size() < 2 + digits || !hex(line.substr(1, digits), id) || id > (extended ? CAN_EFF_MASK : CAN_SFF_MASK)) return Slcan::broken;
    const char length = line[1 + digits];
    if (length < '0' || length > '8') return Slcan::broken;
    memset(&f, 0, sizeof f);
    f.can_id = id | (extended ? CAN_EFF_FLAG : 0) | (remote ? CAN_RTR_FLAG : 0);
    f.len = uint8_t(length - '0');
    const size_t data = remote ? 0 : f.len, end = 2 + digits + 2 * data;
    if (line.size() != end && line.size() != end + 4) return Slcan::broken;
    for (size_t k = 0; k < data; ++k) {
        if (!hex(line.substr(2 + digits + 2 * k, 2), byte)) return Slcan::broken;
        f.data[k] = uint8_t(byte);
    }
    return line.size() == end || hex(line.substr(end), byte) ? Slcan::frame : Slcan::broken;
}

size_t slcan_print(const canfd_frame& f, char* out) {
    static const char digits[] = "0123456789ABCDEF";
    const bool extended = f.can_id & CAN_EFF_FLAG;
    char* p = out;
    *p++ = extended ? 'T' : 't';
    const uint32_t id = f.can_id & CAN_EFF_MASK;
    for (int shift = extended ? 28 : 8; shift >= 0; shift -= 4) *p++ = digits[id >> shift & 15];
    *p++ = char('0' + f.len);
    for (int k = 0; k < f.len; ++k) *p++ = digits[f.data[k] >> 4], *p++ = digits[f.data[k] & 15];
    *p++ = '\r';
    return size_t(p - out);
}

}  // namespace gw
