// Bit counting for host and device.
#pragma once

#include <bit>
#include <cstdint>

#include "base/hd.h"

namespace raydix {

#if defined(__SIZEOF_INT128__) && !defined(__CUDACC__)
/// What no processor has in one register: for hosts alone.
__extension__ using Uint128 = unsigned __int128;
#endif

RAYDIX_HD inline int leading_zeros(std::uint32_t x) {
#if defined(__CUDA_ARCH__)
    return __clz(static_cast<int>(x));
#else
    return std::countl_zero(x);
#endif
}

RAYDIX_HD inline int leading_zeros(std::uint64_t x) {
#if defined(__CUDA_ARCH__)
    return __clzll(static_cast<long long>(x));
#else
    return std::countl_zero(x);
#endif
}

RAYDIX_HD inline int count_ones(std::uint64_t x) {
#if defined(__CUDA_ARCH__)
    return __popcll(x);
#else
    return std::popcount(x);
#endif
}

/// The lowest bit that is set. For hosts; x is not 0.
inline int lowest_one(std::uint64_t x) { return std::countr_zero(x); }

#if defined(__SIZEOF_INT128__) && !defined(__CUDACC__)
inline int count_ones(Uint128 x) {
    return std::popcount(static_cast<std::uint64_t>(x)) +
           std::popcount(static_cast<std::uint64_t>(x >> 64));
}
inline int lowest_one(Uint128 x) {
    const auto low = static_cast<std::uint64_t>(x);
    return low != 0 ? std::countr_zero(low)
                    : 64 + std::countr_zero(static_cast<std::uint64_t>(x >> 64));
}
#endif

}  // namespace raydix
