// The second half of the triangle test: what floats decide of any hit, then t, u and v in doubles,
// for vectors of rays and for one triangle alone. Included once per instruction set.
#if defined(RAYDIX_SIMD_BLOCK_HITS_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_SIMD_BLOCK_HITS_H
#undef RAYDIX_SIMD_BLOCK_HITS_H
#else
#define RAYDIX_SIMD_BLOCK_HITS_H
#endif

#include <hwy/highway.h>

#include "trace/simd/lanes.h"
#include "trace/simd/seen_corners.h"
#include "trace/simd/wide_ray.h"
#include "trace/triangle_test.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// What of a ray's hits is wanted. Of accepted ones a HitCheck says which count.
enum class Wanted { closest, any, all, closest_accepted, any_accepted };

constexpr bool wants_closest(Wanted wanted) {
    return wanted == Wanted::closest || wanted == Wanted::closest_accepted;
}
constexpr bool wants_any(Wanted wanted) {
    return wanted == Wanted::any || wanted == Wanted::any_accepted;
}
constexpr bool wants_accepted(Wanted wanted) {
    return wanted == Wanted::closest_accepted || wanted == Wanted::any_accepted;
}

constexpr EdgeRule edge_rule(Wanted wanted) {
    return wanted == Wanted::all ? EdgeRule::half_open : EdgeRule::closed;
}

/// A corner in the sheared plane, and how far it is from where rays start along their longest axis.
template <class D>
struct Sheared {
    hn::Vec<D> x, y, z;
};
template <class D>
HWY_INLINE hn::Vec<D> edge(const Sheared<D>& a, const Sheared<D>& b) {
    return hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x));
}

/// Rays for triangles, axes as the rays have them.
template <class D>
struct Limits {
    hn::Vec<D> tmin, tmax, way;  // way: the direction along the longest axis
    float pad;                   // as boxes have it
    bool negative;               // way is
};

/// What floats leave open where any hit will do: most often they tell that t is within
/// [tmin, tmax], or that it is not (docs/algorithms/triangle-test.md, "Any hit").
struct AnyHit {
    std::uint32_t open, certain;  // certain: of the clear ones, those that surely hit
};
/// `clear`: lanes none of whose edge functions u, v, w is 0 or NaN. `early`: with a jump where the
/// depths of corners decide all.
template <bool early = true, class D>
HWY_INLINE AnyHit any_hit(D d, const Limits<D>& ray, const Sheared<D>& a, const Sheared<D>& b,
                          const Sheared<D>& c, hn::Vec<D> u, hn::Vec<D> v, hn::Vec<D> w,
                          std::uint32_t candidates, std::uint32_t clear) {
    using V = hn::Vec<D>;
    const auto ahead = [&](V z) { return ray.negative ? hn::Neg(z) : z; };
    const V za = ahead(a.z), zb = ahead(b.z), zc = ahead(c.z);
    const V least = hn::Min(hn::Min(za, zb), zc), most = hn::Max(hn::Max(za, zb), zc);
    const V rate = hn::Abs(ray.way), pad = hn::Set(d, ray.pad);
    const V first = hn::Mul(ray.tmin, rate), last = hn::Mul(ray.tmax, rate);
    // As slabs do for boxes, along one axis.
    candidates &=
        ~bits_of(d, hn::Or(hn::Gt(least, hn::Add(last, pad)), hn::Lt(most, hn::Sub(first, pad))));
    if (early && candidates == 0) return {0, 0};
    // Wholly between both ends. Strictly: an infinite depth tells nothing.
    const std::uint32_t between =
        candidates & clear &
        bits_of(d, hn::And(hn::Lt(hn::Add(most, pad), last), hn::Gt(hn::Sub(least, pad), first)));
    if (early && between == candidates) return {0, between};
    // (depth of the hit - least) * area is within `error` of `above`.
    const auto weighed = [&](V e, V z) { return hn::Mul(e, hn::Sub(z, least)); };
    const auto beside = [](const Sheared<D>& p) { return hn::Max(hn::Abs(p.x), hn::Abs(p.y)); };
    const V sum = hn::Add(hn::Add(u, v), w), area = hn::Abs(sum);
    const V above = hn::Xor(hn::Add(hn::Add(weighed(u, za), weighed(v, zb)), weighed(w, zc)),
                            hn::Xor(sum, area));
    const V lateral = hn::Max(hn::Max(beside(a), beside(b)), beside(c));
    const V far = hn::Max(hn::Neg(least), most), spread = hn::Sub(most, least);
    const V corners = hn::Mul(hn::Mul(lateral, hn::Set(d, 0x1p-17f)), hn::Add(lateral, far));
    const V error =
        hn::Add(hn::Mul(corners, spread), hn::Mul(hn::Mul(far, hn::Set(d, 0x1p-21f)), area));
    // Without what overflow or underflow would do.
    const std::uint32_t known =
        bits_of(d, hn::And(hn::Gt(error, hn::Set(d, 0x1p-80f)),
                           hn::Lt(hn::Max(area, spread), hn::Set(d, 0x1p60f))));
    const auto level = [&](V depth) {
        return hn::Mul(hn::Max(hn::Sub(hn::Min(depth, most), least), hn::Zero(d)), area);
    };
    const V at_first = level(first), at_last = level(last);
    const V at_least = hn::Sub(above, error), at_most = hn::Add(above, error);
    const std::uint32_t misses =
        bits_of(d, hn::Or(hn::Gt(at_least, at_last), hn::Lt(at_most, at_first)));
    const std::uint32_t hits =
        bits_of(d, hn::And(hn::Le(at_most, at_last), hn::Ge(at_least, at_first)));
    const std::uint32_t certain = between | (candidates & known & clear & hits);
    return {candidates & ~(known & misses) & ~certain, certain};
}

namespace weights {

#include "trace/corner_weights.h"

/// The floats that become a vector of doubles.
template <class D>
using HalfOf = hn::Rebind<float, D>;

template <class D>
HWY_INLINE hn::Vec<D> spread(D d, float x) {
    return hn::PromoteTo(d, hn::Set(HalfOf<D>(), x));
}

template <class D>
HWY_INLINE CornerWeights<hn::Vec<D>> weigh(D d, const hn::Vec<D> (&corner)[3][3],
                                           const hn::Vec<D> (&direction)[3]) {
    using VD = hn::Vec<D>;
    const auto narrow = [](VD x) {
        const hn::RebindToUnsigned<D> bits;
        return hn::And(x, hn::BitCast(D(), hn::Set(bits, narrow_digits)));
    };
    // One rounding, fused or not: both products are exact.
    const auto edge = [](VD a, VD b, VD c, VD e) { return hn::MulSub(a, b, hn::Mul(c, e)); };
    return weigh_corners(corner, direction, hn::Set(d, 1.0), narrow, edge);
}

/// Bits of the lanes that are inside in double, too.
template <class D>
HWY_INLINE std::uint32_t inside(D d, const CornerWeights<hn::Vec<D>>& at) {
    const auto zero = hn::Zero(d);
    return bits_of(d, hn::And(hn::And(hn::Ge(at.u, zero), hn::Ge(at.v, zero)), hn::Ge(at.w, zero)));
}

/// As a float; -0 becomes +0.
template <class D>
HWY_INLINE hn::Vec<HalfOf<D>> rounded(D, hn::Vec<D> x) {
    const HalfOf<D> h;
    return hn::Add(hn::DemoteTo(h, x), hn::Zero(h));
}

/// The largest distance of a corner along kz.
template <class V>
HWY_INLINE V farthest(const V (&corner)[3][3]) {
    return hn::Max(hn::Max(hn::Abs(corner[0][2]), hn::Abs(corner[1][2])), hn::Abs(corner[2][2]));
}
/// Lanes in which no corner is far for a hit so deep.
template <class D>
HWY_INLINE hn::Mask<D> near_corner(D d, hn::Vec<D> farthest, hn::Vec<D> depth) {
    return hn::Le(farthest, hn::Mul(hn::Abs(depth), hn::Set(d, far_corner)));
}
/// Lanes that has_far_corner leaves alone.
template <class D>
HWY_INLINE std::uint32_t without_far_corner(D d, hn::Vec<D> farthest, hn::Vec<D> t, hn::Vec<D> tmin,
                                            hn::Vec<D> way) {
    const auto rate = hn::Abs(way), depth = hn::Mul(t, rate);
    const auto near = near_corner(d, farthest, depth);
    const auto slack = hn::Mul(farthest, hn::Set(d, far_corner_slack));
    return bits_of(d, hn::Or(near, hn::Lt(hn::Add(depth, slack), hn::Mul(tmin, rate))));
}

}  // namespace weights

/// finish_hit, but for the limits of t and the area, for one ray and one triangle of a block, none
/// of whose edge functions is 0 or NaN: most hits. Blocks hold no triangle without area. `origin`
/// and `direction` are followed by a float more. `alone`: of a ray by itself. Vectors of 512 bits
/// would slow down the shorter ones around it on some processors
/// (docs/performance/single-calls.md). False: test_exactly must be asked.
template <bool alone>
HWY_INLINE bool hit_lane(const TriangleBlock& block, std::uint32_t lane, const float* origin,
                         const float* direction, const RayClass& kind, float tmin,
                         TriangleHit& hit) {
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3
    // weigh_corners with a corner in each lane. The fourth lane's edge function is 0.
    const __m256d way = _mm256_cvtps_pd(_mm_set1_ps(direction[kind.kz]));
#if HWY_TARGET == HWY_AVX3
    const SeenCorners seen = alone ? see_corners(block, lane, origin, direction, kind, way)
                                   : see_corners_at_once(block, lane, origin, direction, kind, way);
#else
    const SeenCorners seen = see_corners(block, lane, origin, direction, kind, way);
#endif
    const __m256d at = _mm256_fmsub_pd(seen.y, seen.next_x, _mm256_mul_pd(seen.x, seen.next_y));
    const __m256d halves = _mm256_hadd_pd(at, _mm256_mul_pd(at, seen.depth));
    const __m128d sums =
        _mm_add_pd(_mm256_castpd256_pd128(halves), _mm256_extractf128_pd(halves, 1));
    const double along = _mm256_cvtsd_f64(way);
    const double inverse = 1.0 / (_mm_cvtsd_f64(sums) * along);
    const double t = _mm_cvtsd_f64(_mm_unpackhi_pd(sums, sums)) * inverse;
    const __m256d weight = _mm256_mul_pd(at, _mm256_set1_pd(inverse * along));
    HWY_ALIGN float weights[4];
    _mm_store_ps(weights, _mm_add_ps(_mm256_cvtpd_ps(weight), _mm_setzero_ps()));
    hit = {static_cast<float>(t) + 0.0f, weights[1], weights[2]};
    // without_far_corner, for each corner as the farthest. Vectors, not masks, as in bits_of_le.
    const double rate = std::fabs(along), depth = t * rate;
    const __m256d distance = _mm256_andnot_pd(_mm256_set1_pd(-0.0), seen.depth);
    const __m256d near =
        _mm256_cmp_pd(distance, _mm256_set1_pd(std::fabs(depth) * far_corner), _CMP_LE_OQ);
    const __m256d slack = _mm256_mul_pd(distance, _mm256_set1_pd(far_corner_slack));
    const __m256d before = _mm256_cmp_pd(_mm256_add_pd(_mm256_set1_pd(depth), slack),
                                         _mm256_set1_pd(tmin * rate), _CMP_LT_OQ);
    const __m256d inside = _mm256_cmp_pd(weight, _mm256_setzero_pd(), _CMP_GE_OQ);
    return (_mm256_movemask_pd(_mm256_and_pd(inside, _mm256_or_pd(near, before))) & 7) == 7;
#else
    const TriangleRay ray =
        triangle_ray_of(kind, {origin[0], origin[1], origin[2]},
                        {direction[0], direction[1], direction[2]}, 0.0f, 0.0f, tmin);
    const SeenTriangle seen = seen_by(ray, triangle_of(block, lane));
    const CornerWeights<double> at = weigh_corners(seen);
    const double rate = std::fabs(seen.direction[2]);
    hit = rounded_hit(at.t, at.u, at.v);
    return at.u >= 0.0 && at.v >= 0.0 && at.w >= 0.0 &&
           !has_far_corner(seen.farthest(), at.t * rate, tmin * rate);
#endif
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
