// Rays of a caller -> vectors of their components, and their classes. Included once per instruction
// set.
#if defined(RAYDIX_SIMD_RAY_VECTORS_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_SIMD_RAY_VECTORS_H
#undef RAYDIX_SIMD_RAY_VECTORS_H
#else
#define RAYDIX_SIMD_RAY_VECTORS_H
#endif

#include <raydix/types.h>

#include <limits>

#include "trace/simd/lanes.h"
#include "trace/simd/quads.h"
#include "trace/simd/ray_classes.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// Rays index[0] to index[lanes16 - 1], a vector a component: origin, tmin; direction, tmax.
struct RayVectors {
    V16 place[4], way[4];
};

HWY_INLINE RayVectors read_rays(const Ray* rays, const std::int32_t* index) {
    RayVectors out;
    load_quads([&](std::size_t l) { return &rays[index[l]].origin.x; }, out.place);
    load_quads([&](std::size_t l) { return &rays[index[l]].direction.x; }, out.way);
    return out;
}

/// The class codes of rays.
HWY_INLINE hn::Vec<I16> classify(const RayVectors& ray) {
    const V16 x = ray.way[0], y = ray.way[1], z = ray.way[2];
    const V16 ax = hn::Abs(x), ay = hn::Abs(y), az = hn::Abs(z);
    const V16 longest = hn::Max(hn::Max(ax, ay), az);
    const I16 d;
    const auto sign = [&](V16 component, int place) {
        return hn::And(hn::ShiftRight<31>(hn::BitCast(d, component)), hn::Set(d, place));
    };
    const auto axis =
        hn::IfThenElse(hn::RebindMask(d, hn::Eq(az, longest)), hn::Set(d, 16),
                       hn::IfThenElseZero(hn::RebindMask(d, hn::Eq(ay, longest)), hn::Set(d, 8)));
    const auto code = hn::Or(hn::Or(sign(x, 1), sign(y, 2)), hn::Or(sign(z, 4), axis));
    const V16 tmin = ray.place[3], tmax = ray.way[3];
    const V16 far = hn::Set(f16, std::numeric_limits<float>::max());
    const auto origin_ok =
        hn::And(hn::And(hn::Le(hn::Abs(ray.place[0]), far), hn::Le(hn::Abs(ray.place[1]), far)),
                hn::Le(hn::Abs(ray.place[2]), far));
    // Each against the longest, since a NaN may have been dropped.
    const auto direction_ok = hn::And(
        hn::And(hn::And(hn::Le(ax, longest), hn::Le(ay, longest)), hn::Le(az, longest)),
        hn::And(hn::Gt(longest, hn::Set(f16, 0x1p-3f)), hn::Lt(longest, hn::Set(f16, 0x1p3f))));
    const auto limits_ok = hn::And(hn::Le(tmin, tmax), hn::Ge(tmax, hn::Zero(f16)));
    const auto ok = hn::And(hn::And(origin_ok, direction_ok), limits_ok);
    return hn::IfThenElse(hn::RebindMask(d, ok), code, hn::Set(d, int{odd_ray_class}));
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
