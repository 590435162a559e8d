// direction_scale (trace/ray_frame.h) of lengths that are neither near 1 nor extreme, from their
// bits: no calls, on the host.
#pragma once

#include <bit>
#include <cstdint>

namespace raydix {

/// Directions of these lengths and of those between them are scaled by a power of two that is an
/// ordinary float, as its inverse is.
inline constexpr float plainly_scaled_from = 0x1p-100f, plainly_scaled_to = 0x1p100f;

inline bool is_plainly_scaled(double longest) {
    return longest >= double{plainly_scaled_from} && longest <= double{plainly_scaled_to};
}

/// Of a length that is_plainly_scaled.
inline float plain_scale(float longest) {
    const std::uint32_t power = std::bit_cast<std::uint32_t>(longest) & 0xFFu << 23;
    return std::bit_cast<float>((254u << 23) - power);
}
inline double plain_scale(double longest) {
    const std::uint64_t power = std::bit_cast<std::uint64_t>(longest) & std::uint64_t{0x7FF} << 52;
    return std::bit_cast<double>((std::uint64_t{2046} << 52) - power);
}

}  // namespace raydix
