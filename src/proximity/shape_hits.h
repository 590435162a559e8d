// Where rays meet the surfaces of spheres and capsules, in float and in double.
#pragma once

#include <raydix/shapes.h>
#include <raydix/types.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "base/double3.h"
#include "base/scalar.h"
#include "proximity/round_shapes.h"

namespace raydix {

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
inline bool surface_hit(const AnyRay& ray, const ShapeLine& line, const Stay& stay, AnyHit& hit) {
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

}  // namespace raydix
