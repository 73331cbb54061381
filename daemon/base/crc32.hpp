// SPDX-License-Identifier: Apache-2.0
// CRC-32 (IEEE 802.3, reflected, as zlib and Python's binascii).
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

namespace gw {

namespace detail {
constexpr std::array<uint32_t, 256> crc32_table() {
    std::array<uint32_t, 256> table{};
    for (uint32_t i = 0; i < 256; ++i) {
        uint32_t c = i;
        for (int k = 0; k < 8; ++k) c = (c & 1u) ? 0xEDB88320u ^ (c >> 1) : c >> 1;
        table[i] = c;
    }
    return table;
}
inline constexpr auto kCrcTable = crc32_table();
}  // namespace detail

inline uint32_t crc32(const void* data, size_t size, uint32_t start = 0) {
    auto p = static_cast<const uint8_t*>(data);
    uint32_t c = ~start;
    for (size_t i = 0; i < size; ++i) c = detail::kCrcTable[(c ^ p[i]) & 0xFFu] ^ (c >> 8);
    return ~c;
}

}  // namespace gw
