// The plain structs that every other header speaks in: points, boxes, rays, hits.
// In float32, and those that end in `d` or `D` in double. All may be copied byte for byte.
#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <limits>

namespace raydix {

struct Vec3 {
    float x, y, z;
};

/// Axis-aligned box, closed on all sides. `lo > hi` on any axis means "empty".
struct Aabb {
    Vec3 lo, hi;
};

struct Vec3d {
    double x, y, z;
};
struct AabbD {
    Vec3d lo, hi;
};

/// Three vertex indices.
using Triangle = std::array<std::uint32_t, 3>;

inline constexpr float infinity = std::numeric_limits<float>::infinity();

/// Stands in `Hit::prim` for "nothing was hit".
inline constexpr std::uint32_t no_primitive = 0xFFFFFFFFu;

/// Origin + t * direction for t in [tmin, tmax]. The direction need not be of unit length; t is in
/// its units. A negative tmin counts as 0. Invalid are rays with tmin > tmax, tmax < 0, a limit
/// that is NaN, a direction of 0, or an origin or direction that is not finite. Invalid rays miss
/// and are counted.
struct Ray {
    Vec3 origin;
    float tmin = 0.0f;
    Vec3 direction;
    float tmax = infinity;
};
static_assert(sizeof(Ray) == 32);

/// What a ray hits in one tree: the point (1-u-v)*v0 + u*v1 + v*v2 of triangle `prim`, at `t` along
/// the ray, in units of its direction. A miss has t infinity and prim no_primitive.
struct TreeHit {
    float t = infinity;
    std::uint32_t prim = no_primitive;
    float u = 0.0f, v = 0.0f;

    [[nodiscard]] constexpr bool hit() const { return prim != no_primitive; }
};
static_assert(sizeof(TreeHit) == 16);

/// A hit and where in a scene it is. `prim` counts within `geometry`, whose id is that of the scene
/// that holds it. `instance` 0: that is the scene itself. Else `instance` is the number of the path
/// of instances that leads there: paths count from 1, depth first, by ascending id (Scene::path). t
/// is always in units of the caller's direction, whatever an instance scales. A hit of one tree
/// alone has geometry 0; a miss has no_primitive.
struct Hit : TreeHit {
    std::uint32_t geometry = no_primitive;
    std::uint32_t instance = 0;
};
static_assert(sizeof(Hit) == 24);

/// A hit of the only geometry there is.
[[nodiscard]] constexpr Hit hit_of_tree(const TreeHit& hit) {
    return {hit, hit.hit() ? 0 : no_primitive, 0};
}

/// As Ray, TreeHit and Hit, in double.
struct RayD {
    Vec3d origin;
    double tmin = 0.0;
    Vec3d direction;
    double tmax = std::numeric_limits<double>::infinity();
};
static_assert(sizeof(RayD) == 64);

struct TreeHitD {
    double t = std::numeric_limits<double>::infinity();
    std::uint32_t prim = no_primitive;
    double u = 0.0, v = 0.0;

    [[nodiscard]] constexpr bool hit() const { return prim != no_primitive; }
    friend constexpr bool operator==(const TreeHitD&, const TreeHitD&) = default;
};
static_assert(sizeof(TreeHitD) == 32);

struct HitD : TreeHitD {
    std::uint32_t geometry = no_primitive;
    std::uint32_t instance = 0;

    friend constexpr bool operator==(const HitD&, const HitD&) = default;
};
static_assert(sizeof(HitD) == 40);

/// The same in double. Braces alone mean a TreeHit.
template <std::derived_from<TreeHitD> AnyHit>
[[nodiscard]] constexpr HitD hit_of_tree(const AnyHit& hit) {
    return {hit, hit.hit() ? 0 : no_primitive, 0};
}

}  // namespace raydix
