// The plain structs that every other header speaks in: points, boxes, rays, hits.
//
// What has coordinates is one template over their type, here and in all headers: BasicRay<float> is
// Ray, and BasicRay<double> is RayD. What is said of one holds for both, each in its own type,
// unless it says so. The structs of this header may be copied byte for byte.
#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <limits>

namespace raydix {

template <class Scalar>
struct BasicVec3 {
    Scalar x, y, z;
};
using Vec3 = BasicVec3<float>;
using Vec3d = BasicVec3<double>;

/// Axis-aligned box, closed on all sides. `lo > hi` on any axis means "empty".
template <class Scalar>
struct BasicAabb {
    BasicVec3<Scalar> lo, hi;
};
using Aabb = BasicAabb<float>;
using AabbD = BasicAabb<double>;

/// Three vertex indices.
using Triangle = std::array<std::uint32_t, 3>;

inline constexpr float infinity = std::numeric_limits<float>::infinity();

/// Stands in `Hit::prim` for "nothing was hit".
inline constexpr std::uint32_t no_primitive = 0xFFFFFFFFu;

/// Origin + t * direction for t in [tmin, tmax]. The direction need not be of unit length; t is in
/// its units. A negative tmin counts as 0. Invalid are rays with tmin > tmax, tmax < 0, a limit
/// that is NaN, a direction of 0, or an origin or direction that is not finite. Invalid rays miss
/// and are counted.
template <class Scalar>
struct BasicRay {
    BasicVec3<Scalar> origin;
    Scalar tmin = 0;
    BasicVec3<Scalar> direction;
    Scalar tmax = std::numeric_limits<Scalar>::infinity();
};
using Ray = BasicRay<float>;
using RayD = BasicRay<double>;
static_assert(sizeof(Ray) == 32 && sizeof(RayD) == 64);

/// What a ray hits in one tree: the point (1-u-v)*v0 + u*v1 + v*v2 of triangle `prim`, at `t` along
/// the ray, in units of its direction. A miss has t infinity and prim no_primitive.
template <class Scalar>
struct BasicTreeHit {
    Scalar t = std::numeric_limits<Scalar>::infinity();
    std::uint32_t prim = no_primitive;
    Scalar u = 0, v = 0;

    [[nodiscard]] constexpr bool hit() const { return prim != no_primitive; }
    friend constexpr bool operator==(const BasicTreeHit&, const BasicTreeHit&) = default;
};
using TreeHit = BasicTreeHit<float>;
using TreeHitD = BasicTreeHit<double>;
static_assert(sizeof(TreeHit) == 16 && sizeof(TreeHitD) == 32);

/// A hit and where in a scene it is. `prim` counts within `geometry`, whose id is that of the scene
/// that holds it. `instance` 0: that is the scene itself. Else `instance` is the number of the path
/// of instances that leads there: paths count from 1, depth first, by ascending id (Scene::path). t
/// is always in units of the caller's direction, whatever an instance scales. A hit of one tree
/// alone has geometry 0; a miss has no_primitive.
template <class Scalar>
struct BasicHit : BasicTreeHit<Scalar> {
    std::uint32_t geometry = no_primitive;
    std::uint32_t instance = 0;

    friend constexpr bool operator==(const BasicHit&, const BasicHit&) = default;
};
using Hit = BasicHit<float>;
using HitD = BasicHit<double>;
static_assert(sizeof(Hit) == 24 && sizeof(HitD) == 40);

/// A hit of the only geometry there is.
[[nodiscard]] constexpr Hit hit_of_tree(const TreeHit& hit) {
    return {hit, hit.hit() ? 0 : no_primitive, 0};
}
template <std::derived_from<TreeHitD> AnyHit>  // braces alone mean a TreeHit
[[nodiscard]] constexpr HitD hit_of_tree(const AnyHit& hit) {
    return {hit, hit.hit() ? 0 : no_primitive, 0};
}

}  // namespace raydix
