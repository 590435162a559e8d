// Powers of two out of and into doubles, bit for bit what std::frexp and std::ldexp give. Device
// compilers without a library of their own have neither.
#pragma once

#include <bit>
#include <cstdint>

#include "base/hd.h"

namespace raydix {

/// 2^n for n in [-1022, 1023].
RAYDIX_HD inline double power_of_two(int n) {
    return std::bit_cast<double>(static_cast<std::uint64_t>(n + 1023) << 52);
}

/// x = result * 2^*exponent with |result| in [1/2, 1). 0, infinities and NaN come back as they are,
/// with exponent 0.
RAYDIX_HD inline double split_exponent(double x, int* exponent) {
    *exponent = 0;
    auto bits = std::bit_cast<std::uint64_t>(x);
    int biased = static_cast<int>(bits >> 52 & 0x7FF);
    if (biased == 0x7FF || x == 0) return x;
    int shifted = 0;
    if (biased == 0) {  // denormal: made normal first
        x *= power_of_two(64);
        bits = std::bit_cast<std::uint64_t>(x);
        biased = static_cast<int>(bits >> 52 & 0x7FF);
        shifted = 64;
    }
    *exponent = biased - 1022 - shifted;
    return std::bit_cast<double>((bits & ~(std::uint64_t{0x7FF} << 52)) | std::uint64_t{1022}
                                                                              << 52);
}

/// x * 2^n, rounded once.
RAYDIX_HD inline double scale_exponent(double x, int n) {
    constexpr int up = 1023;
    // So little at a time that a result which is not 0 in the end is not rounded on the way.
    constexpr int down = 969;
    for (int turn = 0; turn < 2 && n > up; ++turn) {
        x *= power_of_two(up);
        n -= up;
    }
    for (int turn = 0; turn < 2 && n < -1022; ++turn) {
        x *= power_of_two(-down);
        n += down;
    }
    return x * power_of_two(n > up ? up : n < -1022 ? -1022 : n);
}

}  // namespace raydix
