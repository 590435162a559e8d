// Equality of bits, which tells 0 from -0 and does not mind NaN.
#pragma once

#include <bit>
#include <cstdint>

#include "base/math.h"

namespace raydix {

inline bool same_bits(float a, float b) {
    return std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b);
}
inline bool same_bits(Vec3 a, Vec3 b) {
    return same_bits(a.x, b.x) && same_bits(a.y, b.y) && same_bits(a.z, b.z);
}

/// Finite, within the range of contract.md 1, and without -0.
inline bool is_clean(Vec3 p) { return in_range(p) && same_bits(p, without_negative_zero(p)); }

}  // namespace raydix
