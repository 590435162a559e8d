// Spheres, capsules and points with a radius: their boxes, and where rays meet their surfaces. In
// float and in double.
#include <raydix/user_geometry.h>
#include <raydix/user_geometry_d.h>

#include <type_traits>

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

/// A ray's line as a shape around `middle` sees it: its origin, relative to there, is where it
/// comes closest, at t0. `t_scale`: what t of the line are multiplied with to be those of the ray.
struct ShapeLine {
    Path path;
    double t0, t_scale;

    /// A direction in double is scaled, or its square could overflow. What rounding leaves of a
    /// very long way along the line is taken away by products that an axis of direction 0 has no
    /// part in: there the line is where the ray is.
    template <class AnyRay>
    ShapeLine(const AnyRay& ray, Double3 middle) : t_scale(1.0) {
        Double3 d(ray.direction);
        if constexpr (std::is_same_v<AnyRay, RayD>) {
            t_scale = direction_scale(std::max({std::fabs(d.x), std::fabs(d.y), std::fabs(d.z)}));
            d = d * t_scale;
        }
        const Double3 from = Double3(ray.origin) - middle;
        const double d2 = dot(d, d);
        t0 = -dot(from, d) / d2;
        Double3 near = from + d * t0;
        const double rest = dot(near, d);
        if (rest * rest > 0x1p-40 * dot(near, near) * d2) {
            near = cross(d, cross(near, d)) * (1.0 / d2);
            t0 -= rest / d2;
        }
        path = {near, d, 0.0, never};
    }
    /// Whether the square of the line's distance from the middle is at most this.
    [[nodiscard]] bool is_within(double distance2) const {
        return dot(path.origin, path.origin) <= distance2;
    }
};

/// The first end of the line's stay within the ray's limits.
template <class AnyRay, class AnyHit>
bool surface_hit(const AnyRay& ray, const ShapeLine& line, const Stay& stay, AnyHit& hit) {
    using Scalar = decltype(hit.t);
    if (stay.empty()) return false;
    // Rounded: what rounds to the end of the ray is a hit, or ties would be lost.
    const auto enter = static_cast<Scalar>((line.t0 + stay.enter) * line.t_scale),
               leave = static_cast<Scalar>((line.t0 + stay.leave) * line.t_scale);
    const Scalar tmin = max_of(ray.tmin, Scalar(0));
    hit.t = (enter >= tmin ? enter : leave) + Scalar(0);  // -0 becomes +0
    return hit.t >= tmin && hit.t <= min_of(ray.tmax, std::numeric_limits<Scalar>::max());
}

template <class Point, class AnyRay, class AnyHit>
bool hit_ball(Point center, double radius, const AnyRay& ray, AnyHit& hit) {
    const ShapeLine line(ray, Double3(center));
    if (!line.is_within(1.01 * (radius * radius))) return false;
    return surface_hit(ray, line, stay_in_ball(line.path, {}, radius), hit);
}

template <class AnyCapsule, class AnyRay, class AnyHit>
bool hit_capsule(const AnyCapsule& capsule, const AnyRay& ray, AnyHit& hit) {
    using Scalar = decltype(hit.t);
    const Double3 middle = Double3(capsule.a) * 0.5 + Double3(capsule.b) * 0.5,
                  a = Double3(capsule.a) - middle, b = Double3(capsule.b) - middle, axis = b - a;
    const double r = capsule.radius, length2 = dot(axis, axis);
    const ShapeLine line(ray, middle);
    // The square of a sum is at most twice the sum of squares; and what rounding may take.
    if (!line.is_within(2.01 * (0.25 * length2 + r * r))) return false;
    if (!surface_hit(ray, line, stay_in_capsule(line.path, a, axis, r), hit)) return false;
    const Double3 from_a = line.path.at(hit.t / line.t_scale - line.t0) - a;
    const double along = length2 > 0.0 ? dot(from_a, axis) / length2 : 0.0;
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
