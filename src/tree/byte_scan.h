// How far a run of bytes above a threshold goes, sixteen bytes at a time where the processor can.
#pragma once

#include <bit>
#include <cstdint>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace raydix {

#if defined(__SSE2__)
/// Bit k is set if p[k] <= threshold.
inline std::uint32_t not_above_mask(const std::uint8_t* p, std::uint8_t threshold) {
    const __m128i bytes = _mm_loadu_si128(reinterpret_cast<const __m128i*>(p));
    const __m128i limit = _mm_set1_epi8(static_cast<char>(threshold));
    return static_cast<std::uint32_t>(
        _mm_movemask_epi8(_mm_cmpeq_epi8(_mm_min_epu8(bytes, limit), bytes)));
}
#else
inline std::uint32_t not_above_mask(const std::uint8_t* p, std::uint8_t threshold) {
    std::uint32_t mask = 0;
    for (int k = 0; k < 16; ++k) mask |= std::uint32_t{p[k] <= threshold} << k;
    return mask;
}
#endif

/// How many of p[0], p[1], ... are above `threshold` before the first that is not; at most `limit`,
/// a multiple of 16.
inline std::uint32_t count_above(const std::uint8_t* p, std::uint32_t limit,
                                 std::uint8_t threshold) {
    for (std::uint32_t at = 0; at < limit; at += 16) {
        const std::uint32_t mask = not_above_mask(p + at, threshold);
        if (mask != 0) return at + static_cast<std::uint32_t>(std::countr_zero(mask));
    }
    return limit;
}

/// The same for p[-1], p[-2], ...
inline std::uint32_t count_above_backward(const std::uint8_t* p, std::uint32_t limit,
                                          std::uint8_t threshold) {
    for (std::uint32_t at = 0; at < limit; at += 16) {
        const std::uint32_t mask = not_above_mask(p - at - 16, threshold);
        if (mask != 0) return at + static_cast<std::uint32_t>(std::countl_zero(mask << 16));
    }
    return limit;
}

}  // namespace raydix
