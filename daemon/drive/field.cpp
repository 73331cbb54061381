// SPDX-License-Identifier: Apache-2.0
#include "drive/field.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace gw {

namespace {

constexpr double kTwoPi = 6.283185307179586476925286766559;

uint64_t low_bits(unsigned n) { return (uint64_t(1) << n) - 1; }  // of a byte

int64_t sign_extend(uint64_t raw, unsigned bits) {
    if (bits >= 64) return int64_t(raw);
    const uint64_t sign = uint64_t(1) << (bits - 1);
    return int64_t((raw ^ sign) - sign);
}

Number can_number(const FieldConfig& c) {
    if (c.encoding == "f32") return Number::f32;
    if (c.encoding == "f64") return Number::f64;
    return c.is_signed ? Number::signed_integer : Number::unsigned_integer;
}

}  // namespace

size_t BitField::bytes() const {
    if (!big) return (start + length - 1u) / 8 + 1;
    const unsigned in_first = start % 8 + 1u;
    return start / 8 + 1u + (std::max<unsigned>(length, in_first) - in_first + 7) / 8;
}

uint64_t BitField::extract(const uint8_t* data) const {
    uint64_t value = 0;
    unsigned byte = start / 8, left = length;
    if (big) {
        unsigned available = start % 8 + 1u;
        while (left > 0) {
            const unsigned take = std::min(available, left);
            value = value << take | (data[byte] >> (available - take) & low_bits(take));
            left -= take, ++byte, available = 8;
        }
        return value;
    }
    unsigned skip = start % 8, done = 0;
    while (left > 0) {
        const unsigned take = std::min(8 - skip, left);
        value |= (uint64_t(data[byte]) >> skip & low_bits(take)) << done;
        left -= take, done += take, ++byte, skip = 0;
    }
    return value;
}

Scaler::Scaler(const FieldConfig& c, Number number, unsigned bits)
    : number_(number), bits_(bits), scale_(c.scale), offset_(c.offset), min_(c.min), max_(c.max), max_rate_(c.max_rate) {
    const bool integer = number == Number::unsigned_integer || number == Number::signed_integer;
    if (c.counts_per_turn > 0) {
        scale_ = kTwoPi / c.counts_per_turn;
        if (integer) wrap_ = bits >= 64 ? ~uint64_t(0) : uint64_t(1) << bits;
    }
    if (c.wrap_counts > 0 && integer) wrap_ = uint64_t(c.wrap_counts);
    scale_ *= c.gear_ratio;
}

double Scaler::plain(uint64_t raw) const {
    switch (number_) {
        case Number::signed_integer: return double(sign_extend(raw, bits_));
        case Number::f32: {
            float f;
            const uint32_t low = uint32_t(raw);
            memcpy(&f, &low, sizeof f);
            return f;
        }
        case Number::f64: {
            double d;
            memcpy(&d, &raw, sizeof d);
            return d;
        }
        default: return double(raw);
    }
}

Scaler::Result Scaler::convert(uint64_t raw, int64_t t_ns, double& value) {
    if (wrap_ == 0) {
        const double v = plain(raw) * scale_ + offset_;
        if (!std::isfinite(v) || v < min_ || v > max_) return Result::out_of_range;
        const bool jump = primed_ && std::abs(v - last_value_) > max_rate_ * std::max(1e-9, double(t_ns - last_ns_) * 1e-9);
        primed_ = true, last_value_ = v, last_ns_ = t_ns;
        value = v;
        return jump ? Result::jump : Result::ok;
    }
    const bool is_signed = number_ == Number::signed_integer;
    const int64_t first = is_signed ? sign_extend(raw, bits_) : int64_t(raw);
    if (wrap_ != ~uint64_t(0)) {
        const bool below = is_signed && first < 0;  // an angle from -180 to 180 degrees: its place on the turn
        if ((below ? 0 - uint64_t(first) : raw) >= wrap_) return Result::out_of_range;
        if (below) raw = uint64_t(first) + wrap_;
    }
    int64_t step = 0;
    if (!primed_) {
        count_ = first;
    } else if (wrap_ == ~uint64_t(0)) {
        step = int64_t(raw - last_raw_);
    } else {  // the shorter way round
        const uint64_t forward = raw >= last_raw_ ? raw - last_raw_ : raw + (wrap_ - last_raw_);
        step = forward >= wrap_ - forward ? -int64_t(wrap_ - forward) : int64_t(forward);
    }
    const bool jump = primed_ && std::abs(double(step) * scale_) > max_rate_ * std::max(1e-9, double(t_ns - last_ns_) * 1e-9);
    if (!jump && __builtin_add_overflow(count_, step, &count_)) return Result::out_of_range;
    const double v = double(count_) * scale_ + offset_;
    if (v < min_ || v > max_) {
        count_ -= step;
        return Result::out_of_range;
    }
    primed_ = true, last_raw_ = raw, last_ns_ = t_ns, last_value_ = v;
    value = v;
    return jump ? Result::jump : Result::ok;
}

CanField::CanField(const FieldConfig& c) : extended(c.extended || c.pgn >= 0), number(can_number(c)) {
    if (c.pgn >= 0) {
        // PDU1 (format below 0xF0) carries a destination in the low byte of the group: it is not part of the match.
        const bool addressed = (c.pgn >> 8 & 0xFF) < 0xF0;
        mask = addressed ? 0x03FF0000u : 0x03FFFF00u;
        can_id = uint32_t(c.pgn) << 8 & mask;
    } else {
        mask = extended ? 0x1FFFFFFFu : 0x7FFu;
        can_id = uint32_t(c.can_id);
    }
    const bool big = c.byte_order == "big";
    const int64_t length = number == Number::f32 ? 32 : number == Number::f64 ? 64 : c.length;
    bits = {uint16_t(c.start_bit), uint8_t(length), big};
    has_mux = c.mux_length > 0;
    mux = {uint16_t(c.mux_start_bit), uint8_t(c.mux_length), big};
    mux_value = uint64_t(c.mux_value);
}

RegisterField::RegisterField(const FieldConfig& c)
    : address(uint16_t(c.address)), holding(c.table == "holding"), low_word_first(c.word_order == "little"), swap_bytes(c.byte_order == "little") {
    const std::string& e = c.encoding;
    const unsigned bits = e.empty() ? 16 : unsigned(std::stoi(e.substr(1)));
    count = uint16_t(bits / 16);
    number = e == "f32" ? Number::f32 : e == "f64" ? Number::f64 : !e.empty() && e[0] == 'i' ? Number::signed_integer : Number::unsigned_integer;
}

uint64_t RegisterField::extract(const uint16_t* registers) const {
    uint64_t value = 0;
    for (unsigned k = 0; k < count; ++k) {
        uint16_t word = registers[low_word_first ? count - 1 - k : k];
        if (swap_bytes) word = uint16_t(word << 8 | word >> 8);
        value = value << 16 | word;
    }
    return value;
}

}  // namespace gw
