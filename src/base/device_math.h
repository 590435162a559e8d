// Arithmetic that is one instruction each on a GPU.
#pragma once

#include <cmath>

#include "base/hd.h"
#include "base/math.h"

namespace raydix {

/// a * b + c, rounded once.
RAYDIX_HD static inline float multiply_add(float a, float b, float c) {
#if defined(__CUDA_ARCH__)
    return __fmaf_rn(a, b, c);
#elif defined(__FMA__)
    return __builtin_fmaf(a, b, c);
#else
    return std::fma(a, b, c);
#endif
}

// Neither of them may be NaN.
RAYDIX_HD static inline float lesser(float a, float b) {
#if defined(__CUDA_ARCH__)
    return fminf(a, b);
#else
    return min_of(a, b);
#endif
}
RAYDIX_HD static inline float greater(float a, float b) {
#if defined(__CUDA_ARCH__)
    return fmaxf(a, b);
#else
    return max_of(a, b);
#endif
}

}  // namespace raydix
