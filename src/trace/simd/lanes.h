// Vectors of 8 and of up to 16 floats for the instruction set being compiled. Included once per
// instruction set.
#if defined(RAYDIX_SIMD_LANES_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_SIMD_LANES_H
#undef RAYDIX_SIMD_LANES_H
#else
#define RAYDIX_SIMD_LANES_H
#endif

#include <hwy/highway.h>

#include <cstdint>
#include <cstring>

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Eight children or triangles: one vector, or two where vectors are shorter.
using F8 = hn::CappedTag<float, 8>;
using I8 = hn::RebindToSigned<F8>;
using U8 = hn::RebindToUnsigned<F8>;
using B8 = hn::Rebind<std::uint8_t, F8>;
constexpr F8 f8;
constexpr std::size_t lanes8 = hn::MaxLanes(f8);

/// Rays of a packet: as many as the widest vector holds.
using F16 = hn::CappedTag<float, 16>;
using I16 = hn::RebindToSigned<F16>;
using U16 = hn::RebindToUnsigned<F16>;
constexpr F16 f16;
constexpr std::size_t lanes16 = hn::MaxLanes(f16);

/// Bit l: lane l of the mask.
template <class D, class Mask>
HWY_INLINE std::uint32_t bits_of(D d, Mask mask) {
    std::uint8_t bytes[8] = {};
    hn::StoreMaskBits(d, mask, bytes);
    std::uint32_t bits;
    std::memcpy(&bits, bytes, sizeof(bits));
    return bits & static_cast<std::uint32_t>((std::uint64_t{1} << hn::MaxLanes(d)) - 1);
}

template <class D>
HWY_INLINE hn::Mask<D> mask_of(D d, std::uint32_t bits) {
    std::uint8_t bytes[8] = {};
    std::memcpy(bytes, &bits, sizeof(bits));
    return hn::LoadMaskBits(d, bytes);
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
