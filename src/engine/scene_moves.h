// Vectors of rays through the inverses of instances, with the bits of one ray after the other
// (scene_ray.h). Included once per instruction set.
#if defined(RAYDIX_ENGINE_SCENE_MOVES_H) == defined(HWY_TARGET_TOGGLE)
#ifdef RAYDIX_ENGINE_SCENE_MOVES_H
#undef RAYDIX_ENGINE_SCENE_MOVES_H
#else
#define RAYDIX_ENGINE_SCENE_MOVES_H
#endif

#include <hwy/highway.h>

#include <cmath>
#include <limits>

#include "engine/scene_job.h"
#include "engine/scene_ray.h"
#include "trace/simd/packets.h"

HWY_BEFORE_NAMESPACE();
namespace raydix::HWY_NAMESPACE {

/// Half of a vector of rays, in double.
struct HalfOfRays {
    using D = hn::Repartition<double, F16>;
    using H = weights::HalfOf<D>;
    using V = hn::Vec<D>;
    V origin[3], direction[3];

    /// Through one inverse: ((x + y) + z) + move, nothing fused.
    HWY_INLINE void enter(const WayIn& way) {
        const D d;
        V from[3], along[3];
        for (int a = 0; a < 3; ++a) from[a] = origin[a], along[a] = direction[a];
        for (int a = 0; a < 3; ++a) {
            const V x = hn::Set(d, way.columns[0][a]), y = hn::Set(d, way.columns[1][a]),
                    z = hn::Set(d, way.columns[2][a]);
            origin[a] = hn::Add(
                hn::Add(hn::Add(hn::Mul(x, from[0]), hn::Mul(y, from[1])), hn::Mul(z, from[2])),
                hn::Set(d, way.columns[3][a]));
            direction[a] =
                hn::Add(hn::Add(hn::Mul(x, along[0]), hn::Mul(y, along[1])), hn::Mul(z, along[2]));
        }
    }
    /// Whether floats say so of all directions.
    [[nodiscard]] HWY_INLINE bool is_near_unit_length() const {
        const H h;
        const auto size = [&](int a) { return hn::Abs(weights::rounded(D(), direction[a])); };
        const auto longest = hn::Max(hn::Max(size(0), size(1)), size(2));
        return hn::AllTrue(
            h, hn::And(hn::Gt(longest, hn::Set(h, 0x1p-3f)), hn::Lt(longest, hn::Set(h, 0x1p3f))));
    }
};

/// Whether rays of these classes are all valid and near unit length.
HWY_INLINE bool all_usual(hn::Vec<I16> codes) {
    const auto odd = hn::Set(I16(), static_cast<std::int32_t>(odd_ray_class));
    return hn::AllTrue(I16(), hn::Ne(codes, odd));
}

/// Whether a direction, a power of two times the caller's, has all digits of it. The least of
/// ordinary floats may be what less was rounded to.
HWY_INLINE bool keeps_digits(Vec3 scaled, Vec3 given) {
    const auto keeps = [](float x, float from) {
        return std::fabs(x) > std::numeric_limits<float>::min() || from == 0;
    };
    return keeps(scaled.x, given.x) && keeps(scaled.y, given.y) && keeps(scaled.z, given.z);
}

/// Scales a ray, the longest of its components being `longest`. False, and nothing, if parts and
/// meshes need different scales of it.
inline HWY_NOINLINE bool rescale(float longest, Ray& ray, double& scale) {
    const double by = line_scale(double{longest});
    if (by > largest_ray_scale) return false;
    scale = by;
    const Double3 scaled = Double3(ray.direction) * by;
    ray.direction = scaled.rounded();
    ray.tmin = start_in_units(ray.tmin, by);
    ray.tmax = end_in_units(by, ray.tmax);
    return true;
}

/// The class of packet_size rays; odd_ray_class if they differ.
HWY_INLINE std::uint32_t class_of(const Ray* rays, const std::int32_t* index) {
    const auto first = classify(read_rays(rays, index));
    const auto code = hn::Set(I16(), hn::GetLane(first));
    auto same = hn::Eq(first, code);
    for (std::size_t i = lanes16; i < packet_size; i += lanes16)
        same = hn::And(same, hn::Eq(classify(read_rays(rays, index + i)), code));
    return hn::AllTrue(I16(), same) ? static_cast<std::uint32_t>(hn::GetLane(code)) : odd_ray_class;
}

/// Into a placed scene. False, and nothing, if any of them needs another scale, or can hit nothing
/// there.
HWY_INLINE bool move_rays(const SceneTree& scene, const PlacedScene& placed, RayVectors& rays) {
    using Half = HalfOfRays;
    const Half::D d;
    const Half::H h;
    constexpr std::size_t lanes = hn::MaxLanes(d);
    HWY_ALIGN float place[3][lanes16], way[3][lanes16];
    for (int a = 0; a < 3; ++a) {
        hn::Store(rays.place[a], f16, place[a]);
        hn::Store(rays.way[a], f16, way[a]);
    }
    for (std::size_t l = 0; l < lanes16; l += lanes) {
        Half half;
        for (int a = 0; a < 3; ++a) {
            half.origin[a] = hn::PromoteTo(d, hn::Load(h, place[a] + l));
            half.direction[a] = hn::PromoteTo(d, hn::Load(h, way[a] + l));
        }
        half.enter(placed.way);
        if (!half.is_near_unit_length()) return false;
        for (std::uint32_t k = 0; k < placed.more; ++k) {
            half.enter(scene.ways[placed.first + k]);
            if (!half.is_near_unit_length()) return false;
        }
        for (int a = 0; a < 3; ++a) {
            hn::Store(weights::rounded(d, half.origin[a]), h, place[a] + l);
            hn::Store(weights::rounded(d, half.direction[a]), h, way[a] + l);
        }
    }
    RayVectors out = rays;  // with its limits
    for (int a = 0; a < 3; ++a) {
        out.place[a] = hn::Load(f16, place[a]);
        out.way[a] = hn::Load(f16, way[a]);
    }
    if (!all_usual(classify(out))) return false;
    rays = out;
    return true;
}

}  // namespace raydix::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
