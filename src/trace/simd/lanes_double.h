// Vectors of four doubles, one vector or two, and of as many as one holds. Included once per
// instruction set.
#if defined(RAYDIX_SIMD_LANES_DOUBLE_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_SIMD_LANES_DOUBLE_H
#undef RAYDIX_SIMD_LANES_DOUBLE_H
#else
#define RAYDIX_SIMD_LANES_DOUBLE_H
#endif

#include "trace/simd/lanes.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// One ray's axes, or the triangles of a block.
using D4 = hn::CappedTag<double, 4>;
constexpr D4 d4;
constexpr std::size_t lanes_d4 = hn::MaxLanes(d4);

/// Rays of a packet.
using D8 = hn::CappedTag<double, 8>;
constexpr D8 d8;
constexpr std::size_t lanes_d8 = hn::MaxLanes(d8);

/// Four of them as floats.
template <class D = D4>
HWY_INLINE hn::Vec<F4> rounded(const double* from) {
    const D d;
    if constexpr (hn::MaxLanes(d) == 4) {
        return hn::DemoteTo(f4, hn::Load(d, from));
    } else {
        alignas(16) float out[4];
        for (int a = 0; a < 4; ++a) out[a] = static_cast<float>(from[a]);
        return hn::Load(f4, out);
    }
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
