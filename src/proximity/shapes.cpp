// Boxes around spheres, capsules and points with a radius, and functions that know how rays meet
// them. In float and in double.
#include <raydix/user_geometry.h>
#include <raydix/user_geometry_d.h>

#include "base/scalar.h"
#include "proximity/shape_hits.h"
#include "tree/around_center.h"
#include "tree/outward_box.h"

namespace raydix {
namespace {

/// The largest number that is not above x - y.
float below(float x, float y) { return round_down(double(x) - double(y)); }
double below(double x, double y) { return below_difference(x, y) + 0.0; }

template <class Scalar>
Scalar above(Scalar x, Scalar y) {
    return Scalar(0) - below(-x, y);
}

/// Around balls of one radius; NaN for shapes that are none, so that builders leave them out.
template <class Scalar>
BoxOf<Scalar> grown(VecOf<Scalar> lo, VecOf<Scalar> hi, Scalar r) {
    constexpr Scalar nan = std::numeric_limits<Scalar>::quiet_NaN();
    if (!is_finite(lo) || !is_finite(hi) ||
        !(r >= 0 && r < std::numeric_limits<Scalar>::infinity()))
        return {{nan, nan, nan}, {nan, nan, nan}};
    return {{below(lo.x, r), below(lo.y, r), below(lo.z, r)},
            {above(hi.x, r), above(hi.y, r), above(hi.z, r)}};
}

/// box(i) for i in [0, n).
template <class Box>
auto boxes_by(std::size_t n, const Box& box) {
    std::vector<decltype(box(std::size_t{0}))> boxes(n);
    for (std::size_t i = 0; i < n; ++i) boxes[i] = box(i);
    return boxes;
}

template <class AnyCapsule>
auto box_of_capsule(const AnyCapsule& c) {
    using Scalar = decltype(c.radius + 0);
    const bool finite = is_finite(c.a) && is_finite(c.b);  // a minimum may lose a NaN
    return grown<Scalar>(min_of(c.a, c.b), max_of(c.a, c.b), finite ? c.radius : Scalar(-1));
}

}  // namespace

std::vector<Aabb> boxes_of(std::span<const Sphere> spheres) {
    return boxes_by(spheres.size(), [&](std::size_t i) {
        return grown(spheres[i].center, spheres[i].center, spheres[i].radius);
    });
}
std::vector<AabbD> boxes_of(std::span<const SphereD> spheres) {
    return boxes_by(spheres.size(), [&](std::size_t i) {
        return grown(spheres[i].center, spheres[i].center, spheres[i].radius);
    });
}

std::vector<Aabb> boxes_of(std::span<const Capsule> capsules) {
    return boxes_by(capsules.size(), [&](std::size_t i) { return box_of_capsule(capsules[i]); });
}
std::vector<AabbD> boxes_of(std::span<const CapsuleD> capsules) {
    return boxes_by(capsules.size(), [&](std::size_t i) { return box_of_capsule(capsules[i]); });
}

std::vector<Aabb> boxes_of(std::span<const Vec3> points, float radius) {
    return boxes_by(points.size(),
                    [&](std::size_t i) { return grown(points[i], points[i], radius); });
}
std::vector<AabbD> boxes_of(std::span<const Vec3d> points, double radius) {
    return boxes_by(points.size(),
                    [&](std::size_t i) { return grown(points[i], points[i], radius); });
}

IntersectPrimitive intersect_spheres(std::span<const Sphere> spheres) {
    return [spheres](std::uint32_t prim, const Ray& ray, Hit& hit) {
        return hit_ball(spheres[prim].center, spheres[prim].radius, ray, hit);
    };
}
IntersectPrimitiveD intersect_spheres(std::span<const SphereD> spheres) {
    return [spheres](std::uint32_t prim, const RayD& ray, HitD& hit) {
        return hit_ball(spheres[prim].center, spheres[prim].radius, ray, hit);
    };
}

IntersectPrimitive intersect_capsules(std::span<const Capsule> capsules) {
    return [capsules](std::uint32_t prim, const Ray& ray, Hit& hit) {
        return hit_capsule(capsules[prim], ray, hit);
    };
}
IntersectPrimitiveD intersect_capsules(std::span<const CapsuleD> capsules) {
    return [capsules](std::uint32_t prim, const RayD& ray, HitD& hit) {
        return hit_capsule(capsules[prim], ray, hit);
    };
}

IntersectPrimitive intersect_points(std::span<const Vec3> points, float radius) {
    return [points, radius](std::uint32_t prim, const Ray& ray, Hit& hit) {
        return hit_ball(points[prim], radius, ray, hit);
    };
}
IntersectPrimitiveD intersect_points(std::span<const Vec3d> points, double radius) {
    return [points, radius](std::uint32_t prim, const RayD& ray, HitD& hit) {
        return hit_ball(points[prim], radius, ray, hit);
    };
}

}  // namespace raydix
