// How far a run of bytes above a threshold goes, sixteen bytes at a time where the processor can.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace raydix {

/// Sixteen unsigned bytes.
#if defined(__SSE2__)
struct Bytes16 {
    __m128i v;
    static Bytes16 load(const std::uint8_t* p) {
        return {_mm_loadu_si128(reinterpret_cast<const __m128i*>(p))};
    }
    static Bytes16 all(std::uint8_t x) { return {_mm_set1_epi8(static_cast<char>(x))}; }
};
inline Bytes16 min_of(Bytes16 a, Bytes16 b) { return {_mm_min_epu8(a.v, b.v)}; }
/// Bit k is set if a[k] <= b[k].
inline std::uint32_t not_above_mask(Bytes16 a, Bytes16 b) {
    return static_cast<std::uint32_t>(
        _mm_movemask_epi8(_mm_cmpeq_epi8(_mm_min_epu8(a.v, b.v), a.v)));
}
#else
struct Bytes16 {
    std::array<std::uint8_t, 16> v;
    static Bytes16 load(const std::uint8_t* p) {
        Bytes16 bytes;
        std::copy(p, p + 16, bytes.v.begin());
        return bytes;
    }
    static Bytes16 all(std::uint8_t x) {
        Bytes16 bytes;
        bytes.v.fill(x);
        return bytes;
    }
};
inline Bytes16 min_of(Bytes16 a, Bytes16 b) {
    for (std::size_t k = 0; k < 16; ++k) a.v[k] = std::min(a.v[k], b.v[k]);
    return a;
}
inline std::uint32_t not_above_mask(Bytes16 a, Bytes16 b) {
    std::uint32_t mask = 0;
    for (std::size_t k = 0; k < 16; ++k) mask |= std::uint32_t{a.v[k] <= b.v[k]} << k;
    return mask;
}
#endif

/// Bit k is set if a[k] == b[k].
#if defined(__SSE2__)
inline std::uint32_t equal_mask(Bytes16 a, Bytes16 b) {
    return static_cast<std::uint32_t>(_mm_movemask_epi8(_mm_cmpeq_epi8(a.v, b.v)));
}
#else
inline std::uint32_t equal_mask(Bytes16 a, Bytes16 b) {
    return not_above_mask(a, b) & not_above_mask(b, a);
}
#endif

/// The first place of `value` in p[0], p[1], ...; it must be there. Reads whole sixteens.
inline std::uint32_t find_byte(const std::uint8_t* p, std::uint8_t value) {
    for (std::uint32_t at = 0;; at += 16) {
        const std::uint32_t mask = equal_mask(Bytes16::load(p + at), Bytes16::all(value));
        if (mask != 0) return at + static_cast<std::uint32_t>(std::countr_zero(mask));
    }
}

/// How many of p[0], p[1], ... are above `threshold` before the first that is not; at most `limit`,
/// a multiple of 16.
inline std::uint32_t count_above(const std::uint8_t* p, std::uint32_t limit,
                                 std::uint8_t threshold) {
    for (std::uint32_t at = 0; at < limit; at += 16) {
        const std::uint32_t mask = not_above_mask(Bytes16::load(p + at), Bytes16::all(threshold));
        if (mask != 0) return at + static_cast<std::uint32_t>(std::countr_zero(mask));
    }
    return limit;
}

/// The same for p[-1], p[-2], ...
inline std::uint32_t count_above_backward(const std::uint8_t* p, std::uint32_t limit,
                                          std::uint8_t threshold) {
    for (std::uint32_t at = 0; at < limit; at += 16) {
        const std::uint32_t mask =
            not_above_mask(Bytes16::load(p - at - 16), Bytes16::all(threshold));
        if (mask != 0) return at + static_cast<std::uint32_t>(std::countl_zero(mask << 16));
    }
    return limit;
}

}  // namespace raydix
