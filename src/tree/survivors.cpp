#include "tree/survivors.h"

#include <algorithm>
#include <bit>

#if defined(__x86_64__) && defined(__GNUC__)
#include <immintrin.h>
#define RAYDIX_WITH_AVX512
#define RAYDIX_AVX512 __attribute__((target("avx512f,avx512bw,avx512vl,bmi2")))
#endif

namespace raydix {
namespace {

ClusterRef ref_at(const ListCopy& copy, std::uint32_t i) {
    return copy.refs != nullptr ? copy.refs[i] : primitive_cluster | i;
}

void keep_one_by_one(const std::int8_t* partners, std::uint32_t begin, std::uint32_t end,
                     const ListCopy& copy, Survivors& out) {
    for (std::uint32_t i = begin; i < end; ++i) {
        out.places[out.count] = i;
        out.pairs[out.pair_count] = out.count;
        out.pair_count += partners[i] > 0;
        out.count += partners[i] >= 0;
    }
    // All lanes at once: each is then one stream through memory, from block to block.
    const std::array<const float*, 6> lanes = copy.lanes;
    const std::array<float*, 6> to = copy.to_lanes;
    for (std::uint32_t k = 0; k < out.count; ++k) {
        const std::uint32_t i = out.places[k];
        for (std::size_t c = 0; c < 6; ++c) to[c][k] = lanes[c][i];
        copy.to_refs[k] = ref_at(copy, i);
    }
}

#if defined(RAYDIX_WITH_AVX512)

/// Other threads write what lies behind a block's survivors, so no store goes over their end.
RAYDIX_AVX512 void keep_by_sixteen(const std::int8_t* partners, std::uint32_t begin,
                                   std::uint32_t end, const ListCopy& copy, Survivors& out) {
    constexpr std::uint32_t width = 16;
    const __m512i first = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    std::uint32_t count = 0, pair_count = 0;
    for (std::uint32_t i = begin; i < end; i += width) {
        const auto inside = static_cast<__mmask16>((1u << std::min(end - i, width)) - 1);
        const __m128i partner = _mm_maskz_loadu_epi8(inside, partners + i);
        const __mmask16 pair = _mm_mask_cmpgt_epi8_mask(inside, partner, _mm_setzero_si128());
        const __mmask16 kept = _mm_mask_cmpge_epi8_mask(inside, partner, _mm_setzero_si128());
        const auto more = static_cast<std::uint32_t>(std::popcount(std::uint32_t{kept}));
        const auto merging = static_cast<__mmask16>(_pext_u32(pair, kept));
        const auto stored = static_cast<__mmask16>((1u << more) - 1);
        const __m512i places = _mm512_add_epi32(first, _mm512_set1_epi32(static_cast<int>(i)));
        _mm512_storeu_si512(&out.places[count], _mm512_maskz_compress_epi32(kept, places));
        _mm512_storeu_si512(
            &out.pairs[pair_count],
            _mm512_maskz_compress_epi32(
                merging, _mm512_add_epi32(first, _mm512_set1_epi32(static_cast<int>(count)))));
        for (std::size_t c = 0; c < 6; ++c)
            _mm512_mask_storeu_ps(
                copy.to_lanes[c] + count, stored,
                _mm512_maskz_compress_ps(kept, _mm512_maskz_loadu_ps(kept, copy.lanes[c] + i)));
        const __m512i refs =
            copy.refs != nullptr
                ? _mm512_maskz_loadu_epi32(kept, copy.refs + i)
                : _mm512_or_si512(places, _mm512_set1_epi32(static_cast<int>(primitive_cluster)));
        _mm512_mask_storeu_epi32(copy.to_refs + count, stored,
                                 _mm512_maskz_compress_epi32(kept, refs));
        count += more;
        pair_count += static_cast<std::uint32_t>(std::popcount(std::uint32_t{pair}));
    }
    out.count = count;
    out.pair_count = pair_count;
}

#endif

}  // namespace

bool has_wide_survivors() {
#if defined(RAYDIX_WITH_AVX512)
    static const bool has = __builtin_cpu_supports("avx512f") &&
                            __builtin_cpu_supports("avx512bw") &&
                            __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("bmi2");
    return has;
#else
    return false;
#endif
}

void keep_survivors(const std::int8_t* partners, std::uint32_t begin, std::uint32_t end,
                    const ListCopy& copy, Survivors& out) {
    keep_survivors(partners, begin, end, copy, out, has_wide_survivors());
}

void keep_survivors(const std::int8_t* partners, std::uint32_t begin, std::uint32_t end,
                    const ListCopy& copy, Survivors& out, [[maybe_unused]] bool wide) {
    out.count = out.pair_count = 0;
#if defined(RAYDIX_WITH_AVX512)
    if (wide) return keep_by_sixteen(partners, begin, end, copy, out);
#endif
    keep_one_by_one(partners, begin, end, copy, out);
}

}  // namespace raydix
