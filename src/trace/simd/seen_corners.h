// The corners of one triangle of a block as one ray sees them, in doubles, a corner in each lane.
// Included once per instruction set.
#if defined(RAYDIX_SIMD_SEEN_CORNERS_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_SIMD_SEEN_CORNERS_H
#undef RAYDIX_SIMD_SEEN_CORNERS_H
#else
#define RAYDIX_SIMD_SEEN_CORNERS_H
#endif

#include <hwy/highway.h>

#include <array>
#include <cstdint>

#include "trace/simd/ray_classes.h"
#include "trace/simd/wide_ray.h"
#include "trace/triangle_test.h"

#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3
HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// x and y as weigh_corners shears them: of v1, v2, v0 and a fourth corner. next_x, next_y: those
/// of v2, v0, v1, and of the fourth once more. depth: along kz, of v0, v1, v2 and a fourth.
struct SeenCorners {
    __m256d x, y, next_x, next_y, depth;
};

constexpr int next_corner = 0b11'00'10'01;

/// `origin` and `direction` are followed by a float more. `way`: the direction along kz.
HWY_INLINE SeenCorners see_corners(const TriangleBlock& block, std::uint32_t lane,
                                   const float* origin, const float* direction,
                                   const RayClass& kind, __m256d way) {
    constexpr std::size_t next = 3 * block_lanes;
    const auto corners = [&](std::uint32_t axis) {
        const float* const first = block.corner[axis] + lane;
        const __m128 v12 =
            _mm_insert_ps(_mm_load_ss(first + next), _mm_load_ss(first + 2 * next), 0x10);
        const __m128 v120 = _mm_insert_ps(v12, _mm_load_ss(first), 0x20);
        return _mm256_sub_pd(_mm256_cvtps_pd(v120), _mm256_cvtps_pd(_mm_set1_ps(origin[axis])));
    };
    const __m256d z = corners(kind.kz);
    const __m256d digits =
        _mm256_castsi256_pd(_mm256_set1_epi64x(static_cast<std::int64_t>(narrow_digits)));
    const auto sheared = [&](std::uint32_t axis) {
        const __m256d aside = _mm256_cvtps_pd(_mm_set1_ps(direction[axis]));
        return _mm256_and_pd(
            _mm256_sub_pd(_mm256_mul_pd(corners(axis), way), _mm256_mul_pd(z, aside)), digits);
    };
    const __m256d x = sheared(kind.kx), y = sheared(kind.ky);
    return {x, y, _mm256_permute4x64_pd(x, next_corner), _mm256_permute4x64_pd(y, next_corner),
            _mm256_permute4x64_pd(z, 0b11'01'00'10)};
}

#if HWY_TARGET == HWY_AVX3

/// Which floats of a block's corners a ray wants, a lane each: along kx of v1, v2, v0, v0; the same
/// along ky and kz; then along kz of v0, v1, v2, v2.
struct CornerPlaces {
    alignas(64) std::int32_t corner[16];  // of lane 0 of the block
    alignas(64) std::int32_t axis[16];
    std::uint16_t last;  // lanes of the ninth row: two vectors hold eight
};
/// [kz, and 3 more where rays go down it]
inline constexpr auto corner_places = [] {
    constexpr std::uint32_t vertex[2][4] = {{1, 2, 0, 0}, {0, 1, 2, 2}};
    std::array<CornerPlaces, 6> table{};
    for (std::uint32_t code = 0; code < 6; ++code) {
        const std::uint32_t kz = code % 3;
        const RayClass kind = ray_class_of(8 * kz + (code < 3 ? 0 : 1u << kz));
        for (std::uint32_t l = 0; l < 16; ++l) {
            const std::uint32_t axis = kind.axis(l / 4 < 2 ? l / 4 : 2);
            const std::uint32_t row = 3 * vertex[l / 12][l % 4] + axis;
            table[code].corner[l] = static_cast<std::int32_t>(block_lanes * row);
            table[code].axis[l] = static_cast<std::int32_t>(axis);
            if (row == 8) table[code].last |= static_cast<std::uint16_t>(1u << l);
        }
    }
    return table;
}();

/// As see_corners, with fewer instructions, in vectors of 512 bits.
HWY_INLINE SeenCorners see_corners_at_once(const TriangleBlock& block, std::uint32_t lane,
                                           const float* origin, const float* direction,
                                           const RayClass& kind, __m256d way) {
    const CornerPlaces& places =
        corner_places[kind.kz + (kind.negative(static_cast<int>(kind.kz)) ? 3 : 0)];
    const __m512i place = _mm512_add_epi32(_mm512_load_si512(places.corner),
                                           _mm512_set1_epi32(static_cast<int>(lane)));
    const __m512 corners =
        _mm512_mask_broadcastss_ps(_mm512_permutex2var_ps(_mm512_loadu_ps(block.corner[0]), place,
                                                          _mm512_loadu_ps(block.corner[4])),
                                   places.last, _mm_load_ss(block.corner[8] + lane));
    const __m512i axis = _mm512_load_si512(places.axis);
    const auto spread = [&](const float* components) {
        return _mm512_permutexvar_ps(axis, _mm512_castps128_ps512(_mm_loadu_ps(components)));
    };
    const auto low = [](__m512 v) { return _mm512_cvtps_pd(_mm512_castps512_ps256(v)); };
    const auto high = [](__m512 v) { return _mm512_cvtps_pd(_mm512_extractf32x8_ps(v, 1)); };
    const __m512 start = spread(origin);
    const __m512d beside = _mm512_sub_pd(low(corners), low(start)),
                  depths = _mm512_sub_pd(high(corners), high(start)),
                  depth = _mm512_shuffle_f64x2(depths, depths, 0b01'00'01'00);
    const __m512d digits =
        _mm512_castsi512_pd(_mm512_set1_epi64(static_cast<std::int64_t>(narrow_digits)));
    const __m512d sheared = _mm512_and_pd(
        _mm512_sub_pd(_mm512_mul_pd(beside, _mm512_broadcastsd_pd(_mm256_castpd256_pd128(way))),
                      _mm512_mul_pd(depth, low(spread(direction)))),
        digits);
    const __m512d next = _mm512_permutex_pd(sheared, next_corner);
    const auto upper = [](__m512d v) { return _mm512_extractf64x4_pd(v, 1); };
    return {_mm512_castpd512_pd256(sheared), upper(sheared), _mm512_castpd512_pd256(next),
            upper(next), upper(depths)};
}

#endif

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
#endif
