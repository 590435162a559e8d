// Bit counting for host and device.
#pragma once

#include <bit>
#include <cstdint>

#include "base/hd.h"

namespace raydix {

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

}  // namespace raydix
