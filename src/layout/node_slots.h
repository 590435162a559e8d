// The slots of a wide node of eight children, all at once: their order, boxes about the middle,
// words.
#pragma once

#include <raydix/types.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "base/x86_intrinsics.h"
#include "layout/search_odds.h"
#include "layout/wide_bvh.h"

namespace raydix {

/// [slot]: which child.
using SlotOrder = std::array<std::uint32_t, quantised_width>;

#if defined(RAYDIX_X86_INTRINSICS)

struct EightRows {
    __m256 of[8];
    [[gnu::always_inline]] __m256& operator[](std::size_t k) { return of[k]; }
};

/// difference_below (about_middle.h).
[[gnu::always_inline]] __attribute__((target("avx2"))) inline __m256 difference_below_8(__m256 a,
                                                                                        __m256 b) {
    const __m256 rounded = _mm256_sub_ps(a, b), of_b = _mm256_sub_ps(rounded, a);
    const __m256 error =
        _mm256_sub_ps(_mm256_sub_ps(a, _mm256_sub_ps(rounded, of_b)), _mm256_add_ps(b, of_b));
    const __m256i bits = _mm256_castps_si256(rounded);
    // 1 for negative ones, else -1.
    const __m256i step =
        _mm256_or_si256(_mm256_srli_epi32(bits, 31),
                        _mm256_xor_si256(_mm256_srai_epi32(bits, 31), _mm256_set1_epi32(-1)));
    const __m256i less = _mm256_castps_si256(_mm256_cmp_ps(error, _mm256_setzero_ps(), _CMP_LT_OQ));
    return _mm256_castsi256_ps(_mm256_add_epi32(bits, _mm256_and_si256(step, less)));
}

[[gnu::always_inline]] __attribute__((target("avx2"))) inline void transpose_8(EightRows& r) {
    EightRows pairs, quads;
    for (std::size_t k = 0; k < 8; k += 2) {
        pairs[k] = _mm256_unpacklo_ps(r[k], r[k + 1]);
        pairs[k + 1] = _mm256_unpackhi_ps(r[k], r[k + 1]);
    }
    for (std::size_t k = 0; k < 8; k += 4) {
        quads[k] = _mm256_shuffle_ps(pairs[k], pairs[k + 2], 0x44);
        quads[k + 1] = _mm256_shuffle_ps(pairs[k], pairs[k + 2], 0xEE);
        quads[k + 2] = _mm256_shuffle_ps(pairs[k + 1], pairs[k + 3], 0x44);
        quads[k + 3] = _mm256_shuffle_ps(pairs[k + 1], pairs[k + 3], 0xEE);
    }
    for (std::size_t k = 0; k < 4; ++k) {
        r[k] = _mm256_permute2f128_ps(quads[k], quads[k + 4], 0x20);
        r[k + 4] = _mm256_permute2f128_ps(quads[k], quads[k + 4], 0x31);
    }
}

/// rows: a child each, the corner lo, its word, the corner hi, its hits; infinite ones, turned
/// round, with wide_no_child and infinite hits for those that there are none of. costs: of the
/// children. Boxes and words of the node, by ascending search_rank: rays that stop at any hit take
/// the last slot first. Equal ranks keep their order, which is returned.
[[gnu::always_inline]] __attribute__((target("avx2"))) inline SlotOrder write_slots_within_avx2(
    EightRows& rows, __m256 costs, Vec3 about, WideNode& node) {
    transpose_8(rows);
    constexpr float least = std::numeric_limits<float>::min();
    const __m256 worth = _mm256_div_ps(rows[7], _mm256_max_ps(costs, _mm256_set1_ps(least)));
    const __m256i lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    __m256i rank = _mm256_setzero_si256();
    for (int other = 0; other < 8; ++other) {
        const __m256i which = _mm256_set1_epi32(other);
        const __m256 its = _mm256_permutevar8x32_ps(worth, which);
        const __m256 equal = _mm256_and_ps(_mm256_cmp_ps(its, worth, _CMP_EQ_OQ),
                                           _mm256_castsi256_ps(_mm256_cmpgt_epi32(lane, which)));
        const __m256 before = _mm256_or_ps(_mm256_cmp_ps(its, worth, _CMP_LT_OQ), equal);
        rank = _mm256_sub_epi32(rank, _mm256_castps_si256(before));
    }
    __m256i from = _mm256_setzero_si256();  // [slot]: the child whose rank it is
    for (int child = 0; child < 8; ++child) {
        const __m256i which = _mm256_set1_epi32(child);
        const __m256i here = _mm256_cmpeq_epi32(_mm256_permutevar8x32_epi32(rank, which), lane);
        from = _mm256_or_si256(from, _mm256_and_si256(here, which));
    }
    const float middle[3] = {about.x, about.y, about.z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const __m256 from_here = _mm256_set1_ps(middle[axis]);
        const __m256 lo = _mm256_permutevar8x32_ps(rows[axis], from),
                     hi = _mm256_permutevar8x32_ps(rows[4 + axis], from);
        _mm256_store_ps(node.lo[axis], difference_below_8(lo, from_here));
        _mm256_store_ps(node.hi[axis],
                        _mm256_xor_ps(difference_below_8(from_here, hi), _mm256_set1_ps(-0.0f)));
    }
    _mm256_store_ps(reinterpret_cast<float*>(node.child), _mm256_permutevar8x32_ps(rows[3], from));
    SlotOrder order;
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(order.data()), from);
    return order;
}

#endif

}  // namespace raydix
