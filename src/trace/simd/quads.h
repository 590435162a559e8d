// Records of 8 floats -> vectors of one component each. Included once per instruction set.
#if defined(RAYDIX_SIMD_QUADS_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_SIMD_QUADS_H
#undef RAYDIX_SIMD_QUADS_H
#else
#define RAYDIX_SIMD_QUADS_H
#endif

#include "trace/simd/lanes.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

using V16 = hn::Vec<F16>;

/// Four floats from every fourth record, one record a 128-bit block: Highway has no name for it.
template <class At>
HWY_INLINE V16 load_row(const At& at, std::size_t first) {
#if HWY_TARGET == HWY_AVX3
    __m512 v = _mm512_castps128_ps512(_mm_loadu_ps(at(first)));
    v = _mm512_insertf32x4(v, _mm_loadu_ps(at(first + 4)), 1);
    v = _mm512_insertf32x4(v, _mm_loadu_ps(at(first + 8)), 2);
    return V16{_mm512_insertf32x4(v, _mm_loadu_ps(at(first + 12)), 3)};
#elif HWY_TARGET == HWY_AVX2
    const __m256 v = _mm256_castps128_ps256(_mm_loadu_ps(at(first)));
    return V16{_mm256_insertf128_ps(v, _mm_loadu_ps(at(first + 4)), 1)};
#else
    static_assert(lanes16 == 4);
    return hn::LoadU(f16, at(first));
#endif
}

/// out[c], lane l: float c of the four at `at(l)`.
template <class At>
HWY_INLINE void load_quads(const At& at, V16 (&out)[4]) {
    const hn::Repartition<double, F16> d64;
    const V16 r0 = load_row(at, 0), r1 = load_row(at, 1), r2 = load_row(at, 2),
              r3 = load_row(at, 3);
    const auto low01 = hn::BitCast(d64, hn::InterleaveLower(f16, r0, r1));
    const auto low23 = hn::BitCast(d64, hn::InterleaveLower(f16, r2, r3));
    const auto high01 = hn::BitCast(d64, hn::InterleaveUpper(f16, r0, r1));
    const auto high23 = hn::BitCast(d64, hn::InterleaveUpper(f16, r2, r3));
    out[0] = hn::BitCast(f16, hn::InterleaveLower(d64, low01, low23));
    out[1] = hn::BitCast(f16, hn::InterleaveUpper(d64, low01, low23));
    out[2] = hn::BitCast(f16, hn::InterleaveLower(d64, high01, high23));
    out[3] = hn::BitCast(f16, hn::InterleaveUpper(d64, high01, high23));
}

/// load_row the other way round.
template <class At>
HWY_INLINE void store_row(V16 row, const At& at, std::size_t first) {
#if HWY_TARGET == HWY_AVX3
    _mm_storeu_ps(at(first), _mm512_castps512_ps128(row.raw));
    _mm_storeu_ps(at(first + 4), _mm512_extractf32x4_ps(row.raw, 1));
    _mm_storeu_ps(at(first + 8), _mm512_extractf32x4_ps(row.raw, 2));
    _mm_storeu_ps(at(first + 12), _mm512_extractf32x4_ps(row.raw, 3));
#elif HWY_TARGET == HWY_AVX2
    _mm_storeu_ps(at(first), _mm256_castps256_ps128(row.raw));
    _mm_storeu_ps(at(first + 4), _mm256_extractf128_ps(row.raw, 1));
#else
    hn::StoreU(row, f16, at(first));
#endif
}

/// Lane l of in[c] becomes float c of the four at `at(l)`.
template <class At>
HWY_INLINE void store_quads(const V16 (&in)[4], const At& at) {
    const hn::Repartition<double, F16> d64;
    const auto low01 = hn::BitCast(d64, hn::InterleaveLower(f16, in[0], in[1]));
    const auto low23 = hn::BitCast(d64, hn::InterleaveLower(f16, in[2], in[3]));
    const auto high01 = hn::BitCast(d64, hn::InterleaveUpper(f16, in[0], in[1]));
    const auto high23 = hn::BitCast(d64, hn::InterleaveUpper(f16, in[2], in[3]));
    store_row(hn::BitCast(f16, hn::InterleaveLower(d64, low01, low23)), at, 0);
    store_row(hn::BitCast(f16, hn::InterleaveUpper(d64, low01, low23)), at, 1);
    store_row(hn::BitCast(f16, hn::InterleaveLower(d64, high01, high23)), at, 2);
    store_row(hn::BitCast(f16, hn::InterleaveUpper(d64, high01, high23)), at, 3);
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
