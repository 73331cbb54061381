// SPDX-License-Identifier: Apache-2.0
#include "record/candump.hpp"

#include <cstring>

namespace gw {

namespace {

int hex(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
}

// "(1436509052.249713)": any number of decimals up to nanoseconds.
bool parse_stamp(std::string_view s, int64_t& t_ns) {
    if (s.size() < 3 || s.front() != '(' || s.back() != ')') return false;
    s = s.substr(1, s.size() - 2);
    int64_t seconds = 0, fraction = 0;
    size_t i = 0, digits = 0;
    for (; i < s.size() && s[i] >= '0' && s[i] <= '9'; ++i) {
        seconds = seconds * 10 + (s[i] - '0');
        if (seconds > 9000000000) return false;
    }
    if (i == 0 || i == s.size() || s[i] != '.') return false;
    for (++i; i < s.size() && digits < 9; ++i, ++digits) {
        if (s[i] < '0' || s[i] > '9') return false;
        fraction = fraction * 10 + (s[i] - '0');
    }
    if (i != s.size() || digits == 0) return false;
    for (; digits < 9; ++digits) fraction *= 10;
    t_ns = seconds * 1000000000 + fraction;
    return true;
}

bool parse_id(std::string_view s, canid_t& id) {
    if (s.size() != 3 && s.size() != 8) return false;
    uint32_t v = 0;
    for (char c : s) {
        const int h = hex(c);
        if (h < 0) return false;
        v = v << 4 | uint32_t(h);
    }
    if (s.size() == 3) {
        if (v > CAN_SFF_MASK) return false;
        id = v;
        return true;
    }
    // Eight digits: 29 bits, or an error frame (bit 29 set).
    if (v & ~(CAN_EFF_MASK | CAN_ERR_FLAG)) return false;
    id = v & CAN_ERR_FLAG ? v : v | CAN_EFF_FLAG;
    return true;
}

bool parse_data(std::string_view s, size_t most, canfd_frame& f) {
    size_t n = 0, i = 0;
    while (i < s.size()) {
        if (s[i] == '.') { ++i; continue; }
        if (s[i] == '_') break;  // raw DLC of a classic frame follows
        if (i + 1 >= s.size() || n >= most) return false;
        const int hi = hex(s[i]), lo = hex(s[i + 1]);
        if (hi < 0 || lo < 0) return false;
        f.data[n++] = uint8_t(hi << 4 | lo);
        i += 2;
    }
    f.len = uint8_t(n);
    return true;
}

bool fd_length(unsigned n) { return n <= 8 || n == 12 || n == 16 || n == 20 || n == 24 || n == 32 || n == 48 || n == 64; }

std::string_view word(std::string_view& rest) {
    const size_t a = rest.find_first_not_of(" \t\r\n");
    if (a == std::string_view::npos) return rest = {}, std::string_view();
    const size_t b = rest.find_first_of(" \t\r\n", a);
    auto w = rest.substr(a, b == std::string_view::npos ? b : b - a);
    rest = b == std::string_view::npos ? std::string_view() : rest.substr(b);
    return w;
}

}  // namespace

bool candump_parse(std::string_view line, CandumpLine& out) {
    memset(&out.frame, 0, sizeof out.frame);
    if (!parse_stamp(word(line), out.t_ns)) return false;
    out.interface = word(line);
    const std::string_view text = word(line);
    const size_t hash = text.find('#');
    if (out.interface.empty() || hash == std::string_view::npos || !parse_id(text.substr(0, hash), out.frame.can_id)) return false;
    std::string_view data = text.substr(hash + 1);
    out.fd = !data.empty() && data[0] == '#';
    if (out.fd) {
        if (data.size() < 2 || hex(data[1]) < 0) return false;
        out.frame.flags = uint8_t(hex(data[1]));
        return parse_data(data.substr(2), 64, out.frame) && fd_length(out.frame.len);
    }
    if (!data.empty() && (data[0] == 'R' || data[0] == 'r')) {
        out.frame.can_id |= CAN_RTR_FLAG;
        const int n = data.size() > 1 ? hex(data[1]) : 0;
        if (n < 0 || n > 8) return false;
        out.frame.len = uint8_t(n);
        return true;
    }
    return parse_data(data, 8, out.frame);
}

}  // namespace gw
