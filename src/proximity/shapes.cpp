// Spheres, capsules and points with a radius: their boxes, and where rays meet their surfaces. In
// float and in double.
#include <raydix/user_geometry.h>
#include <raydix/user_geometry_d.h>

#include "base/scalar.h"
#include "proximity/sweep_walk.h"
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

/// A ray as the shapes see it: its line, what the line's 0 is in the scene, and what t of the line
/// are multiplied with to be those of the ray.
struct ShapeRay {
    Path path;
    Double3 start;
    double t_scale;

    template <class Point>
    [[nodiscard]] Double3 place(Point p) const {
        return Double3(p) - start;
    }
};

ShapeRay shape_ray(const Ray& ray) { return {path_of(ray), {}, 1.0}; }

/// Shapes are taken from the ray's origin, one rounding of a difference, so that a place far from 0
/// costs no digits. The direction is scaled, or its square could overflow.
ShapeRay shape_ray(const RayD& ray) {
    const Vec3d d = ray.direction;
    const double scale =
        direction_scale(max_of(max_of(std::fabs(d.x), std::fabs(d.y)), std::fabs(d.z)));
    return {{{}, Double3(d * scale), 0.0, never}, Double3(ray.origin), scale};
}

Stay stay_in_cylinder_of(const Capsule&, const Path& path, Double3 a, Double3 b, double radius) {
    return stay_in_cylinder(path, a, b, radius);
}
Stay stay_in_cylinder_of(const CapsuleD&, const Path& path, Double3 a, Double3 b, double radius) {
    return stay_in_far_cylinder(path, a, b, radius);
}

/// The first end of the line's stay within the ray's limits.
template <class AnyRay, class AnyHit>
bool surface_hit(const AnyRay& ray, const Stay& stay, double t_scale, AnyHit& hit) {
    using Scalar = decltype(hit.t);
    if (!(stay.enter <= stay.leave)) return false;
    // Rounded: what rounds to the end of the ray is a hit, or ties would be lost.
    const auto enter = static_cast<Scalar>(stay.enter * t_scale),
               leave = static_cast<Scalar>(stay.leave * t_scale);
    const Scalar tmin = max_of(ray.tmin, Scalar(0));
    hit.t = (enter >= tmin ? enter : leave) + Scalar(0);  // -0 becomes +0
    return hit.t >= tmin && hit.t <= min_of(ray.tmax, std::numeric_limits<Scalar>::max());
}

template <class Point, class AnyRay, class AnyHit>
bool hit_ball(Point center, double radius, const AnyRay& ray, AnyHit& hit) {
    const ShapeRay line = shape_ray(ray);
    return surface_hit(ray, stay_in_ball(line.path, line.place(center), radius), line.t_scale, hit);
}

Stay unite(const Stay& a, const Stay& b) {
    if (!(a.enter <= a.leave)) return b;
    if (!(b.enter <= b.leave)) return a;
    return {std::min(a.enter, b.enter), std::max(a.leave, b.leave)};
}

/// Two balls and the cylinder between them: together convex, so the stay is one interval.
template <class AnyCapsule, class AnyRay, class AnyHit>
bool hit_capsule(const AnyCapsule& capsule, const AnyRay& ray, AnyHit& hit) {
    using Scalar = decltype(hit.t);
    const ShapeRay line = shape_ray(ray);
    const Path& path = line.path;
    const Double3 a = line.place(capsule.a), b = line.place(capsule.b);
    const double r = capsule.radius;
    const Stay stay = unite(unite(stay_in_ball(path, a, r), stay_in_ball(path, b, r)),
                            stay_in_cylinder_of(capsule, path, a, b, r));
    if (!surface_hit(ray, stay, line.t_scale, hit)) return false;
    const Double3 axis = b - a;
    const double length2 = dot(axis, axis);
    const double along =
        length2 > 0.0 ? dot(path.at(hit.t / line.t_scale) - a, axis) / length2 : 0.0;
    hit.u = static_cast<Scalar>(std::clamp(along, 0.0, 1.0));
    return true;
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
