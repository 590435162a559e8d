// Writes of whole records. A device writes a struct of words word by word, and each write goes to
// the cache that all share; 16 bytes at a time are a fourth as many.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "base/hd.h"

namespace raydix {

/// 16 bytes that are written at once.
struct alignas(16) Quad {
    std::uint32_t words[4];
};

/// `place`: aligned to 16 bytes where a device runs this.
template <class T>
RAYDIX_HD inline void store_whole(T* place, const T& value) {
    static_assert(std::is_trivially_copyable_v<T> && sizeof(T) % sizeof(Quad) == 0);
#if defined(__CUDA_ARCH__) || defined(__HIP_DEVICE_COMPILE__)
    Quad copy[sizeof(T) / sizeof(Quad)];
    memcpy(copy, &value, sizeof(T));
    auto* to = reinterpret_cast<Quad*>(place);
    for (std::size_t k = 0; k < sizeof(T) / sizeof(Quad); ++k) to[k] = copy[k];
#else
    *place = value;
#endif
}

}  // namespace raydix
