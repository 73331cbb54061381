// SPDX-License-Identifier: Apache-2.0
// Bit fields against a bit-by-bit reading of the DBC numbering, scaling and unwrapping against exact arithmetic.
#include <cmath>
#include <cstring>
#include <random>

#include <gtest/gtest.h>

#include "drive/field.hpp"

using namespace gw;

namespace {

constexpr double kPi = 3.14159265358979323846;

FieldConfig plain() {
    FieldConfig c{};
    c.can_id = 0x181, c.pgn = -1, c.address = -1;
    c.length = 16;
    c.scale = 1, c.gear_ratio = 1;
    c.min = -INFINITY, c.max = INFINITY, c.max_rate = INFINITY;
    return c;
}

// DBC: bit b of the payload is bit b % 8 of byte b / 8. Little-endian fields count upwards from their least significant bit;
// big-endian ones begin at their most significant bit and go down inside a byte, then on with bit 7 of the next.
uint64_t bit_by_bit(const uint8_t* data, unsigned start, unsigned length, bool big) {
    uint64_t value = 0;
    unsigned at = start;
    for (unsigned k = 0; k < length; ++k) {
        const uint64_t bit = data[at / 8] >> at % 8 & 1u;
        value |= bit << (big ? length - 1 - k : k);
        if (!big) ++at;
        else at = at % 8 == 0 ? at + 15 : at - 1;
    }
    return value;
}

TEST(BitField, AgreesWithTheNumberingBitByBit) {
    std::mt19937 random(1);
    uint8_t data[64];
    for (int trial = 0; trial < 20000; ++trial) {
        for (auto& d : data) d = uint8_t(random());
        BitField f;
        f.start = uint16_t(random() % 400);
        f.length = uint8_t(1 + random() % 64);
        f.big = random() % 2;
        ASSERT_LE(f.bytes(), 64u);
        ASSERT_EQ(f.extract(data), bit_by_bit(data, f.start, f.length, f.big)) << f.start << " " << int(f.length) << " " << f.big;
    }
}

TEST(BitField, SaysHowManyBytesItNeeds) {
    EXPECT_EQ((BitField{0, 8, false}.bytes()), 1u);
    EXPECT_EQ((BitField{0, 9, false}.bytes()), 2u);
    EXPECT_EQ((BitField{63, 1, false}.bytes()), 8u);
    EXPECT_EQ((BitField{7, 8, true}.bytes()), 1u);    // byte 0 whole
    EXPECT_EQ((BitField{7, 9, true}.bytes()), 2u);
    EXPECT_EQ((BitField{0, 2, true}.bytes()), 2u);    // bit 0 of byte 0, then bit 7 of byte 1
    EXPECT_EQ((BitField{56, 1, true}.bytes()), 8u);
}

// The last byte that a field touches, found by walking its bits: every length at every place.
TEST(BitField, NeedsExactlyTheBytesThatItTouches) {
    for (unsigned start = 0; start < 64; ++start)
        for (unsigned length = 1; length <= 64; ++length)
            for (bool big : {false, true}) {
                unsigned at = start, last = 0;
                for (unsigned k = 0; k < length; ++k) {
                    last = std::max(last, at / 8);
                    if (!big) ++at;
                    else at = at % 8 == 0 ? at + 15 : at - 1;
                }
                BitField f;
                f.start = uint16_t(start), f.length = uint8_t(length), f.big = big;
                ASSERT_EQ(f.bytes(), last + 1) << start << " " << length << " " << big;
            }
}

TEST(BitField, ReadsKnownBytes) {
    const uint8_t data[8] = {0x12, 0x34, 0x56, 0x78, 0x9A, 0xBC, 0xDE, 0xF0};
    EXPECT_EQ((BitField{0, 16, false}.extract(data)), 0x3412u);
    EXPECT_EQ((BitField{7, 16, true}.extract(data)), 0x1234u);
    EXPECT_EQ((BitField{4, 8, false}.extract(data)), 0x41u);
    EXPECT_EQ((BitField{0, 64, false}.extract(data)), 0xF0DEBC9A78563412u);
    EXPECT_EQ((BitField{7, 64, true}.extract(data)), 0x123456789ABCDEF0u);
}

TEST(Scaler, SignScaleOffset) {
    FieldConfig c = plain();
    c.scale = 0.5, c.offset = 10;
    double v = 0;
    Scaler s(c, Number::signed_integer, 12);
    EXPECT_EQ(s.convert(0x800, 0, v), Scaler::Result::ok);  // most negative of 12 bits
    EXPECT_DOUBLE_EQ(v, -2048 * 0.5 + 10);
    EXPECT_EQ(s.convert(0x7FF, 1, v), Scaler::Result::ok);
    EXPECT_DOUBLE_EQ(v, 2047 * 0.5 + 10);
    Scaler u(c, Number::unsigned_integer, 12);
    EXPECT_EQ(u.convert(0x800, 0, v), Scaler::Result::ok);
    EXPECT_DOUBLE_EQ(v, 2048 * 0.5 + 10);
    Scaler wide(c, Number::signed_integer, 64);
    EXPECT_EQ(wide.convert(~uint64_t(0), 0, v), Scaler::Result::ok);
    EXPECT_DOUBLE_EQ(v, 9.5);
}

TEST(Scaler, FloatsAndWhatIsNoNumber) {
    double v = 7;
    const float f = -3.25f;
    uint32_t bits;
    memcpy(&bits, &f, 4);
    Scaler s(plain(), Number::f32, 32);
    EXPECT_EQ(s.convert(bits, 0, v), Scaler::Result::ok);
    EXPECT_DOUBLE_EQ(v, -3.25);
    v = 7;
    for (uint32_t bad : {0x7FC00000u, 0x7F800000u, 0xFF800000u}) {
        EXPECT_EQ(s.convert(bad, 1, v), Scaler::Result::out_of_range);
        EXPECT_EQ(v, 7) << "a rejected value must not be written";
    }
}

TEST(Scaler, DoublesAreReadAsTheyStand) {
    double v = 0;
    const double d = -1.0 / 3;
    uint64_t bits;
    memcpy(&bits, &d, 8);
    Scaler s(plain(), Number::f64, 64);
    EXPECT_EQ(s.convert(bits, 0, v), Scaler::Result::ok);
    EXPECT_EQ(v, d);
    EXPECT_EQ(s.convert(0x7FF0000000000000u, 1, v), Scaler::Result::out_of_range);
}

TEST(Scaler, EncoderUnwrapsBothWays) {
    FieldConfig c = plain();
    c.counts_per_turn = 4096, c.gear_ratio = -2;
    Scaler s(c, Number::unsigned_integer, 16);
    std::mt19937 random(2);
    int64_t truth = 60000;
    double v;
    ASSERT_EQ(s.convert(uint64_t(truth), 0, v), Scaler::Result::ok);
    for (int k = 1; k < 100000; ++k) {
        truth += int64_t(random() % 65535) - 32767;  // less than half a wrap either way
        ASSERT_EQ(s.convert(uint64_t(truth) & 0xFFFF, k, v), Scaler::Result::ok);
        ASSERT_NEAR(v, double(truth) * 2 * kPi / 4096 * -2, 1e-12 * std::abs(v) + 1e-12);
    }
}

TEST(Scaler, WrapOfOwnSizeAndSignedStart) {
    FieldConfig c = plain();
    c.counts_per_turn = 1000, c.wrap_counts = 1000;
    Scaler s(c, Number::unsigned_integer, 16);
    double v;
    EXPECT_EQ(s.convert(990, 0, v), Scaler::Result::ok);
    EXPECT_EQ(s.convert(10, 1, v), Scaler::Result::ok);
    EXPECT_NEAR(v, 1010 * 2 * kPi / 1000, 1e-12);
    EXPECT_EQ(s.convert(1000, 2, v), Scaler::Result::out_of_range) << "the counter never reaches its wrap";
    FieldConfig wide = plain();
    wide.counts_per_turn = 65536;
    Scaler t(wide, Number::signed_integer, 32);
    EXPECT_EQ(t.convert(0xFFFFFFFFu, 0, v), Scaler::Result::ok);
    EXPECT_NEAR(v, -2 * kPi / 65536, 1e-15);
    EXPECT_EQ(t.convert(0x7FFFFFFFu, 1, v), Scaler::Result::ok);  // half the range back: the shorter way
    EXPECT_NEAR(v, (-1.0 - 2147483648.0) * 2 * kPi / 65536, 1e-6);
}

TEST(Scaler, ASignedAngleWrapsAtItsOwnTurn) {
    FieldConfig c = plain();
    c.scale = 0.1, c.wrap_counts = 3600;  // -180 .. 179.9 degrees
    Scaler s(c, Number::signed_integer, 16);
    double v;
    EXPECT_EQ(s.convert(uint64_t(-1795) & 0xFFFF, 0, v), Scaler::Result::ok);
    EXPECT_NEAR(v, -179.5, 1e-12);
    EXPECT_EQ(s.convert(1795, 1, v), Scaler::Result::ok);
    EXPECT_NEAR(v, -180.5, 1e-12);
    EXPECT_EQ(s.convert(uint64_t(-1800) & 0xFFFF, 2, v), Scaler::Result::ok);
    EXPECT_NEAR(v, -180, 1e-12);
    EXPECT_EQ(s.convert(1800, 3, v), Scaler::Result::ok) << "the other name of -180";
    EXPECT_NEAR(v, -180, 1e-12);
    EXPECT_EQ(s.convert(3600, 4, v), Scaler::Result::out_of_range);
    EXPECT_EQ(s.convert(uint64_t(-3600) & 0xFFFF, 5, v), Scaler::Result::out_of_range);
}

TEST(Scaler, RangeAndJump) {
    FieldConfig c = plain();
    c.min = -5, c.max = 5, c.max_rate = 100;
    Scaler s(c, Number::signed_integer, 16);
    double v = 0;
    EXPECT_EQ(s.convert(6, 0, v), Scaler::Result::out_of_range);
    EXPECT_EQ(s.convert(1, 1000000, v), Scaler::Result::ok);
    EXPECT_EQ(s.convert(4, 2000000, v), Scaler::Result::jump);  // 3 in 1 ms is 3000 per second
    FieldConfig e = plain();
    e.counts_per_turn = 4096, e.max_rate = 1000;
    Scaler encoder(e, Number::unsigned_integer, 32);
    encoder.convert(1000000, 0, v);
    const double before = v;
    EXPECT_EQ(encoder.convert(0, 1000000, v), Scaler::Result::jump);  // the drive came back with its encoder at zero
    EXPECT_EQ(v, before) << "the angle goes on from its last value";
    EXPECT_EQ(encoder.convert(1, 2000000, v), Scaler::Result::ok);
    EXPECT_NEAR(v - before, 2 * kPi / 4096, 1e-9);
}

TEST(CanField, MatchesIdentifiersAndGroups) {
    FieldConfig c = plain();
    CanField f(c);
    EXPECT_TRUE(f.matches(0x181, false));
    EXPECT_FALSE(f.matches(0x181, true)) << "29-bit 0x181 is another identifier";
    c.can_id = -1, c.pgn = 0xF004;  // EEC1
    CanField broadcast(c);
    EXPECT_TRUE(broadcast.matches(0x0CF00400, true));
    EXPECT_TRUE(broadcast.matches(0x18F004FE, true)) << "any priority, any sender";
    EXPECT_FALSE(broadcast.matches(0x18F00500, true));
    c.pgn = 0xEF00;  // addressed: the low byte is the destination
    CanField addressed(c);
    EXPECT_TRUE(addressed.matches(0x18EF1234, true));
    EXPECT_FALSE(addressed.matches(0x18EE1234, true));
}

TEST(CanField, FloatsHaveTheirOwnLength) {
    FieldConfig c = plain();
    c.length = 16, c.encoding = "f32";
    EXPECT_EQ(CanField(c).bytes(), 4u);
    c.encoding = "f64";
    EXPECT_EQ(CanField(c).bytes(), 8u);
    c = plain(), c.mux_length = 8, c.mux_start_bit = 40;
    EXPECT_EQ(CanField(c).bytes(), 6u);
    c.mux_start_bit = 0, c.start_bit = 32;
    EXPECT_EQ(CanField(c).bytes(), 6u);
}

TEST(RegisterField, WordAndByteOrder) {
    FieldConfig c = plain();
    c.can_id = -1, c.address = 10, c.encoding = "u32";
    const uint16_t r[2] = {0x1122, 0x3344};
    c.word_order = "big";
    EXPECT_EQ(RegisterField(c).extract(r), 0x11223344u);
    c.word_order = "little";
    EXPECT_EQ(RegisterField(c).extract(r), 0x33441122u);
    c.byte_order = "little";
    EXPECT_EQ(RegisterField(c).extract(r), 0x44332211u);
    c.word_order = "big";
    EXPECT_EQ(RegisterField(c).extract(r), 0x22114433u);
    c.encoding = "f64";
    EXPECT_EQ(RegisterField(c).count, 4);
}

TEST(Scaler, A64BitCounterWrapsAndWhatIsOutOfItsLimitsIsNotCounted) {
    FieldConfig c = plain();
    c.counts_per_turn = 2 * kPi;  // a count is a radian
    double v = 0;
    Scaler wide(c, Number::unsigned_integer, 64);
    EXPECT_EQ(wide.convert(5, 0, v), Scaler::Result::ok);
    EXPECT_EQ(wide.convert(uint64_t(0) - 3, 1000000, v), Scaler::Result::ok);
    EXPECT_DOUBLE_EQ(v, -3);
    c.max = 20;
    Scaler limited(c, Number::unsigned_integer, 16);
    EXPECT_EQ(limited.convert(10, 0, v), Scaler::Result::ok);
    EXPECT_EQ(limited.convert(25, 1000000, v), Scaler::Result::out_of_range);
    EXPECT_EQ(limited.convert(12, 2000000, v), Scaler::Result::ok);
    EXPECT_DOUBLE_EQ(v, 12) << "the refused value left no trace";
    c.min = 3, c.max = 8;
    Scaler inside(c, Number::unsigned_integer, 16);
    EXPECT_EQ(inside.convert(3, 0, v), Scaler::Result::ok) << "the limits themselves";
    EXPECT_EQ(inside.convert(8, 1000000, v), Scaler::Result::ok);
    EXPECT_EQ(inside.convert(9, 2000000, v), Scaler::Result::out_of_range);
    EXPECT_EQ(inside.convert(2, 3000000, v), Scaler::Result::out_of_range);
}

TEST(Scaler, LimitsAreInclusiveAndTheRateIsPerSecondBetweenTheTwoStamps) {
    FieldConfig c = plain();
    c.min = -5, c.max = 20, c.max_rate = 10;
    double v = 0;
    Scaler s(c, Number::signed_integer, 16);
    EXPECT_EQ(s.convert(20, 1000000000, v), Scaler::Result::ok) << "the upper limit itself";
    EXPECT_EQ(s.convert(21, 3000000000, v), Scaler::Result::out_of_range);
    EXPECT_EQ(s.convert(uint16_t(-5), 3500000000, v), Scaler::Result::ok) << "25 in 2.5 s is 10 a second; the lower limit itself";
    EXPECT_EQ(s.convert(6, 4500000000, v), Scaler::Result::jump) << "11 in one";
    c.counts_per_turn = 2 * kPi;
    Scaler counts(c, Number::unsigned_integer, 16);
    EXPECT_EQ(counts.convert(20, 1000000000, v), Scaler::Result::ok);
    EXPECT_EQ(counts.convert(20, 1500000000, v), Scaler::Result::ok) << "at rest";
    EXPECT_DOUBLE_EQ(v, 20);
    EXPECT_EQ(counts.convert(9, 2500000000, v), Scaler::Result::jump) << "11 in one";
}

// Two readings with one stamp: the rate is that of a nanosecond, not infinite.
TEST(Scaler, TwoReadingsOfOneStamp) {
    FieldConfig c = plain();
    c.max_rate = 1e9;
    double v = 0;
    Scaler s(c, Number::unsigned_integer, 16);
    EXPECT_EQ(s.convert(5, 1000, v), Scaler::Result::ok);
    EXPECT_EQ(s.convert(6, 1000, v), Scaler::Result::ok) << "one in a nanosecond";
    EXPECT_EQ(s.convert(8, 1000, v), Scaler::Result::jump);
    c.counts_per_turn = 2 * kPi;
    Scaler counts(c, Number::unsigned_integer, 16);
    EXPECT_EQ(counts.convert(5, 1000, v), Scaler::Result::ok);
    EXPECT_EQ(counts.convert(6, 1000, v), Scaler::Result::ok);
    EXPECT_EQ(counts.convert(8, 1000, v), Scaler::Result::jump);
    c.max_rate = 10;
    Scaler slow(c, Number::unsigned_integer, 16);
    EXPECT_EQ(slow.convert(20, 1000000000, v), Scaler::Result::ok);
    EXPECT_EQ(slow.convert(30, 2000000000, v), Scaler::Result::ok) << "10 in one second";
    EXPECT_EQ(slow.convert(41, 3000000000, v), Scaler::Result::jump);
}

TEST(Scaler, A64BitFieldHasItsOwnWrapOrAll) {
    FieldConfig c = plain();
    c.counts_per_turn = 2 * kPi;
    double v = 0;
    Scaler whole(c, Number::unsigned_integer, 64);
    EXPECT_EQ(whole.convert(0, 0, v), Scaler::Result::ok);
    EXPECT_EQ(whole.convert(~uint64_t(0), 1000, v), Scaler::Result::ok) << "every pattern of 64 bits is a count";
    EXPECT_DOUBLE_EQ(v, -1);
    EXPECT_EQ(whole.convert(~uint64_t(0) - 1, 2000, v), Scaler::Result::ok);
    EXPECT_DOUBLE_EQ(v, -2);
    c.wrap_counts = 1000;
    Scaler part(c, Number::unsigned_integer, 64);
    EXPECT_EQ(part.convert(999, 0, v), Scaler::Result::ok);
    EXPECT_EQ(part.convert(1000, 1000, v), Scaler::Result::out_of_range);
    EXPECT_EQ(part.convert(0, 2000, v), Scaler::Result::ok);
    EXPECT_DOUBLE_EQ(v, 1000);
}

TEST(Scaler, HalfTheWrapIsABackwardStep) {
    FieldConfig c = plain();
    c.counts_per_turn = 2 * kPi, c.wrap_counts = 10;
    double v = 0;
    Scaler s(c, Number::unsigned_integer, 8);
    EXPECT_EQ(s.convert(0, 0, v), Scaler::Result::ok);
    EXPECT_EQ(s.convert(4, 1000, v), Scaler::Result::ok);
    EXPECT_DOUBLE_EQ(v, 4);
    EXPECT_EQ(s.convert(9, 2000, v), Scaler::Result::ok);
    EXPECT_DOUBLE_EQ(v, -1);
}

TEST(CanField, AGroupOfNumberZeroAndABitThatChoosesThePage) {
    FieldConfig c = plain();
    c.can_id = -1, c.pgn = 0;  // TSC1, addressed
    CanField f(c);
    EXPECT_TRUE(f.extended);
    EXPECT_TRUE(f.matches(0x0C000003, true));
    EXPECT_FALSE(f.matches(0x0C010003, true));
    c.pgn = 0xF000;  // the first that is sent to all
    EXPECT_FALSE(CanField(c).matches(0x18F00100, true));
    c.pgn = 0xEF00;
    EXPECT_TRUE(CanField(c).matches(0x18EFFF00, true));
    c = plain(), c.mux_length = 1, c.mux_start_bit = 63;
    CanField paged(c);
    EXPECT_TRUE(paged.has_mux);
    EXPECT_EQ(paged.bytes(), 8u);
}

TEST(RegisterField, EncodingsSayTheirKindAndTable) {
    FieldConfig c = plain();
    c.can_id = -1, c.address = 10;
    const std::pair<const char*, std::pair<Number, int>> kinds[] = {{"", {Number::unsigned_integer, 1}}, {"u16", {Number::unsigned_integer, 1}}, {"i16", {Number::signed_integer, 1}},
                                                                    {"i32", {Number::signed_integer, 2}}, {"u64", {Number::unsigned_integer, 4}}, {"f32", {Number::f32, 2}}, {"f64", {Number::f64, 4}}};
    for (const auto& [encoding, what] : kinds) {
        c.encoding = encoding;
        EXPECT_EQ(RegisterField(c).number, what.first) << encoding;
        EXPECT_EQ(RegisterField(c).count, what.second) << encoding;
    }
    c.table = "input";
    EXPECT_FALSE(RegisterField(c).holding);
    c.table = "holding";
    EXPECT_TRUE(RegisterField(c).holding);
    EXPECT_EQ(RegisterField(c).address, 10);
}

}  // namespace
