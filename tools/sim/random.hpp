// SPDX-License-Identifier: Apache-2.0
// Seeded random numbers with named streams: the same seed and name give the same draws on every machine.
#pragma once
#include <cmath>
#include <cstdint>
#include <string_view>

namespace sim {

class Random {
public:
    explicit Random(std::uint64_t seed, std::string_view stream = {}) {
        std::uint64_t h = 0xcbf29ce484222325ULL;
        for (char c : stream) h = (h ^ static_cast<unsigned char>(c)) * 0x100000001b3ULL;
        std::uint64_t x = seed ^ h;
        for (auto &s : state_) s = split_mix(x);
    }
    std::uint64_t bits() {  // xoshiro256**
        const std::uint64_t result = rotl(state_[1] * 5, 7) * 9, t = state_[1] << 17;
        state_[2] ^= state_[0]; state_[3] ^= state_[1]; state_[1] ^= state_[2]; state_[0] ^= state_[3];
        state_[2] ^= t; state_[3] = rotl(state_[3], 45);
        return result;
    }
    double uniform() { return static_cast<double>(bits() >> 11) * 0x1.0p-53; }
    double uniform(double lo, double hi) { return lo + (hi - lo) * uniform(); }
    double log_uniform(double lo, double hi) { return lo * std::exp(uniform() * std::log(hi / lo)); }
    int integer(int lo, int hi) { return lo + static_cast<int>(uniform() * (hi - lo + 1)); }
    bool chance(double p) { return uniform() < p; }
    double sign() { return chance(0.5) ? 1.0 : -1.0; }
    double normal() {
        if (spare_ready_) { spare_ready_ = false; return spare_; }
        double u, v, s;
        do { u = uniform(-1, 1); v = uniform(-1, 1); s = u * u + v * v; } while (s >= 1 || s == 0);
        const double f = std::sqrt(-2 * std::log(s) / s);
        spare_ = v * f; spare_ready_ = true;
        return u * f;
    }

private:
    static std::uint64_t rotl(std::uint64_t x, int k) { return (x << k) | (x >> (64 - k)); }
    static std::uint64_t split_mix(std::uint64_t &x) {
        std::uint64_t z = (x += 0x9e3779b97f4a7c15ULL);
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
        return z ^ (z >> 31);
    }
    std::uint64_t state_[4];
    double spare_ = 0;
    bool spare_ready_ = false;
};

}  // namespace sim
