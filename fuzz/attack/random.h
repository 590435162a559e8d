// Seeded random numbers of the attack: the same cases for the same seed on every machine.
#pragma once

#include <raydix/types.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace raydix::attack {

/// One step of SplitMix64: turns any number into one whose bits look random.
constexpr std::uint64_t scramble(std::uint64_t x) {
    x += 0x9E3779B97F4A7C15u;
    x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9u;
    x = (x ^ (x >> 27)) * 0x94D049BB133111EBu;
    return x ^ (x >> 31);
}

/// The seed of case `index` of a kind.
constexpr std::uint64_t case_seed(std::uint64_t seed, std::string_view kind, std::uint64_t index) {
    std::uint64_t mixed = scramble(seed);
    for (const char c : kind) mixed = scramble(mixed ^ static_cast<unsigned char>(c));
    return scramble(mixed ^ index);
}

class Random {
public:
    explicit Random(std::uint64_t seed) : state_(seed) {}

    std::uint64_t bits() { return scramble(state_ += 0x9E3779B97F4A7C15u); }
    /// In [0, n); 0 for n = 0.
    std::uint32_t below(std::size_t n) {
        return n == 0 ? 0 : static_cast<std::uint32_t>((bits() >> 32) % n);
    }
    /// In [lo, hi].
    int whole(int lo, int hi) { return lo + static_cast<int>(below(std::size_t(hi - lo + 1))); }
    bool chance(double p) { return unit() < p; }
    /// In [0, 1).
    double unit() { return static_cast<double>(bits() >> 11) * 0x1p-53; }
    /// In [-1, 1).
    float sign_unit() { return static_cast<float>(2 * unit() - 1); }
    float between(float lo, float hi) { return lo + (hi - lo) * static_cast<float>(unit()); }
    Vec3 cube() { return {sign_unit(), sign_unit(), sign_unit()}; }
    Vec3 whole_point(int reach) {
        return {float(whole(-reach, reach)), float(whole(-reach, reach)),
                float(whole(-reach, reach))};
    }
    /// 10 to a power in [lo, hi].
    float power_of_ten(double lo, double hi) {
        return static_cast<float>(std::pow(10.0, lo + (hi - lo) * unit()));
    }
    template <class T, std::size_t n>
    const T& one_of(const T (&list)[n]) {
        return list[below(n)];
    }

private:
    std::uint64_t state_;
};

}  // namespace raydix::attack
