// The cheapest ways to share i wide subtrees among the two children of a binary node, for every i
// from 2 to the width: the inner step of the dynamic programming of collapse_plan.h.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "base/math.h"
#include "base/x86_intrinsics.h"

namespace raydix {

/// The j-th division of i subtrees among two children, from even ones to uneven ones: among equal
/// costs (flat scenes have no others) the tree stays shallow.
constexpr int left_part(int i, int j) { return j % 2 == 1 ? i / 2 + (j + 1) / 2 : i / 2 - j / 2; }

/// [i - 1]: the cost of i subtrees, and how many of them go to the left child. i = 1 has no
/// meaning.
template <int width>
struct SubtreeShares {
    alignas(32) std::array<float, width> cost;
    alignas(32) std::array<std::int32_t, width> left;
};

/// a, b [width]: costs of the children, [i - 1] as at most i subtrees; the last float of each is
/// not looked at.
template <int width>
SubtreeShares<width> cheapest_shares(const float* a, const float* b) {
    SubtreeShares<width> out;
    out.cost[0] = 0;
    out.left[0] = 0;
#pragma GCC unroll 8
    for (int i = 2; i <= width; ++i) {
        const int even = left_part(i, 0);
        float best = a[even - 1] + b[i - even - 1];
        int best_part = even;
#pragma GCC unroll 8
        for (int j = 1; j < i - 1; ++j) {
            const int left = left_part(i, j);
            const float cost = a[left - 1] + b[i - left - 1];
            best_part = cost < best ? left : best_part;
            best = std::min(best, cost);
        }
        out.cost[static_cast<std::size_t>(i - 1)] = best;
        out.left[static_cast<std::size_t>(i - 1)] = best_part;
    }
    return out;
}

#if defined(RAYDIX_X86_INTRINSICS)

/// Lane i - 1 of [j]: where the two costs of the j-th division of i lie; 7, where there is none.
struct SharePlaces {
    alignas(32) std::array<std::array<std::int32_t, 8>, 7> left, in_a, in_b;
};
inline constexpr SharePlaces share_places = [] {
    SharePlaces out{};
    for (int j = 0; j < 7; ++j)
        for (int i = 1; i <= 8; ++i) {
            const auto row = static_cast<std::size_t>(j), lane = static_cast<std::size_t>(i - 1);
            const bool there = j < i - 1;
            out.left[row][lane] = there ? left_part(i, j) : 0;
            out.in_a[row][lane] = there ? left_part(i, j) - 1 : 7;
            out.in_b[row][lane] = there ? i - left_part(i, j) - 1 : 7;
        }
    return out;
}();

/// The members of SubtreeShares<8>.
struct ShareVectors {
    __m256 cost;
    __m256i left;
};

/// The bits of cheapest_shares<8>, all i at once, for functions compiled for AVX2.
[[gnu::always_inline]] __attribute__((target("avx2"))) inline ShareVectors
cheapest_shares_within_avx2(const float* a, const float* b) {
    const auto* const places_a = reinterpret_cast<const __m256i*>(share_places.in_a.data()->data());
    const auto* const places_b = reinterpret_cast<const __m256i*>(share_places.in_b.data()->data());
    const auto* const lefts = reinterpret_cast<const __m256i*>(share_places.left.data()->data());
    const __m256 none = _mm256_set1_ps(infinity);
    const __m256 from_a = _mm256_blend_ps(_mm256_loadu_ps(a), none, 0x80);
    const __m256 from_b = _mm256_blend_ps(_mm256_loadu_ps(b), none, 0x80);
    std::array<ShareVectors, 7> best;
#pragma GCC unroll 7
    for (std::size_t j = 0; j < 7; ++j) {
        best[j] = {_mm256_add_ps(_mm256_permutevar8x32_ps(from_a, _mm256_load_si256(places_a + j)),
                                 _mm256_permutevar8x32_ps(from_b, _mm256_load_si256(places_b + j))),
                   _mm256_load_si256(lefts + j)};
    }
    // Pairs of neighbours: no step waits for more than two others. Of equal costs the first stays.
#pragma GCC unroll 3
    for (std::size_t step = 1; step < 7; step *= 2)
#pragma GCC unroll 4
        for (std::size_t j = 0; j + step < 7; j += 2 * step) {
            const __m256 less = _mm256_cmp_ps(best[j + step].cost, best[j].cost, _CMP_LT_OQ);
            best[j].cost = _mm256_min_ps(best[j + step].cost, best[j].cost);
            best[j].left =
                _mm256_blendv_epi8(best[j].left, best[j + step].left, _mm256_castps_si256(less));
        }
    return best[0];
}
/// The same for all others, on processors with AVX2.
__attribute__((target("avx2"))) inline SubtreeShares<8> cheapest_shares_avx2(const float* a,
                                                                             const float* b) {
    const ShareVectors shares = cheapest_shares_within_avx2(a, b);
    SubtreeShares<8> out;
    _mm256_store_ps(out.cost.data(), shares.cost);
    _mm256_store_si256(reinterpret_cast<__m256i*>(out.left.data()), shares.left);
    return out;
}

#endif

}  // namespace raydix
