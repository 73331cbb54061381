// SPDX-License-Identifier: Apache-2.0
// A number inside a message: bit field of either byte order (DBC numbering), or Modbus registers, to an SI value.
#pragma once
#include <cstddef>
#include <cstdint>

#include "config/config.hpp"

namespace gw {

struct BitField {
    uint16_t start = 0;
    uint8_t length = 0;
    bool big = false;

    size_t bytes() const;                            // payload bytes that must be there
    uint64_t extract(const uint8_t* data) const;     // data holds at least bytes()
};

enum class Number : uint8_t { unsigned_integer, signed_integer, f32, f64 };

// Raw counts to SI, with the memory that unwrapping needs.
class Scaler {
public:
    enum class Result { ok, jump, out_of_range };

    Scaler() = default;
    explicit Scaler(const FieldConfig& config, Number number, unsigned bits);

    // raw: the bits as they stand in the message. A value is written with ok and with jump (then the angle goes on from its last value).
    Result convert(uint64_t raw, int64_t t_ns, double& value);
    void forget() { primed_ = false; }

private:
    double plain(uint64_t raw) const;

    Number number_ = Number::unsigned_integer;
    unsigned bits_ = 0;
    uint64_t wrap_ = 0;                              // 0: does not wrap; ~0 means 2^64
    double scale_ = 1, offset_ = 0, min_ = 0, max_ = 0, max_rate_ = 0;
    bool primed_ = false;
    uint64_t last_raw_ = 0;
    int64_t count_ = 0, last_ns_ = 0;
    double last_value_ = 0;
};

// Geometry of a field in a CAN payload, or in the registers of one Modbus reply.
struct CanField {
    bool extended = false;
    uint32_t can_id = 0, mask = 0;                   // matches where (id & mask) == can_id
    BitField bits;
    bool has_mux = false;
    BitField mux;
    uint64_t mux_value = 0;
    Number number = Number::unsigned_integer;

    explicit CanField(const FieldConfig& config);
    bool matches(uint32_t id, bool is_extended) const { return is_extended == extended && (id & mask) == can_id; }
    size_t bytes() const { return has_mux && mux.bytes() > bits.bytes() ? mux.bytes() : bits.bytes(); }
};

struct RegisterField {
    uint16_t address = 0, count = 1;
    bool holding = false;
    bool low_word_first = false, swap_bytes = false;
    Number number = Number::unsigned_integer;

    explicit RegisterField(const FieldConfig& config);
    uint64_t extract(const uint16_t* registers) const;  // registers[count], first one at address
};

}  // namespace gw
