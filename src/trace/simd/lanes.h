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

#include "base/compress_lanes.h"

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

/// One ray's axes, or the triangles of a block.
using F4 = hn::FixedTag<float, 4>;
constexpr F4 f4;

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

/// All bits of lane l where a <= b, else none. With AVX-512 a vector, too: masks take longer to
/// come to a general register.
HWY_INLINE hn::Vec<F8> lanes_of_le(hn::Vec<F8> a, hn::Vec<F8> b) {
#if HWY_TARGET == HWY_AVX3
    return hn::Vec<F8>{_mm256_cmp_ps(a.raw, b.raw, _CMP_LE_OQ)};
#else
    return hn::VecFromMask(f8, hn::Le(a, b));
#endif
}
/// Bit l: the first bit of lane l.
HWY_INLINE std::uint32_t bits_of_lanes(hn::Vec<F8> lanes) {
#if HWY_TARGET == HWY_AVX3
    return static_cast<std::uint32_t>(_mm256_movemask_ps(lanes.raw));
#else
    return bits_of(f8, hn::MaskFromVec(lanes));
#endif
}
/// Bit l: a <= b in lane l.
HWY_INLINE std::uint32_t bits_of_le(hn::Vec<F8> a, hn::Vec<F8> b) {
    return bits_of_lanes(lanes_of_le(a, b));
}

/// Bit l: lane l of `least` is below 0 and that of `largest` above it.
HWY_INLINE std::uint32_t bits_astride(hn::Vec<F4> least, hn::Vec<F4> largest) {
#if HWY_TARGET == HWY_AVX3
    const __m128 zero = _mm_setzero_ps();
    return static_cast<std::uint32_t>(_mm_movemask_ps(_mm_and_ps(
        _mm_cmp_ps(least.raw, zero, _CMP_LT_OQ), _mm_cmp_ps(largest.raw, zero, _CMP_GT_OQ))));
#else
    return bits_of(f4, hn::And(hn::Lt(least, hn::Zero(f4)), hn::Gt(largest, hn::Zero(f4))));
#endif
}

/// Lanes with values of both signs.
template <class D>
HWY_INLINE hn::Mask<D> astride(D d, hn::Vec<D> u, hn::Vec<D> v, hn::Vec<D> w) {
    return hn::And(hn::Lt(hn::Min(hn::Min(u, v), w), hn::Zero(d)),
                   hn::Gt(hn::Max(hn::Max(u, v), w), hn::Zero(d)));
}

/// Lanes without a 0 or a NaN.
template <class D>
HWY_INLINE hn::Mask<D> without_zero(D d, hn::Vec<D> u, hn::Vec<D> v, hn::Vec<D> w) {
    const auto zero = hn::Zero(d);
    return hn::And(hn::And(hn::Gt(hn::Abs(u), zero), hn::Gt(hn::Abs(v), zero)),
                   hn::Gt(hn::Abs(w), zero));
}

/// Lanes of the mask moved to the front; `bits` are those of the mask, for where it takes a table.
template <class D>
HWY_INLINE hn::Vec<D> compress(D d, hn::Vec<D> v, [[maybe_unused]] hn::Mask<D> mask,
                               [[maybe_unused]] std::uint32_t bits) {
#if HWY_TARGET == HWY_AVX3
    static_cast<void>(d);
    return hn::Compress(v, mask);
#else
    return compress(d, v, bits);
#endif
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
