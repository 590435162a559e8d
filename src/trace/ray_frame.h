// What a ray's tests share, computed once per ray: validity, scale, the shear of the watertight
// triangle test (Woop, Benthin, Wald 2013, section 3) and reciprocals for slabs. A pure function of
// the ray.
#pragma once

#include <raydix/types.h>

#include <cmath>
#include <limits>

#include "base/hd.h"
#include "base/math.h"
#include "base/scalar.h"

namespace raydix {

RAYDIX_HD inline float component(Vec3 v, int axis) {
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}
RAYDIX_HD inline double component(Vec3d v, int axis) {
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

/// What the triangle test reads.
template <class Scalar>
struct BasicTriangleRay {
    BasicVec3<Scalar> origin, direction;  // the direction scaled
    int kx, ky, kz;  // kz: the longest axis of the direction; kx, ky keep the winding
    Scalar shear_x, shear_y;
    Scalar tmin;  // in units of the scaled direction, within [0, largest number], as tmax is
};
using TriangleRay = BasicTriangleRay<float>;
using TriangleRayD = BasicTriangleRay<double>;

template <class Scalar>
struct BasicRayFrame : BasicTriangleRay<Scalar> {
    BasicVec3<Scalar> inverse;  // 1 / direction; Inf for components of 0, with their sign
    Scalar tmax;
    Scalar t_scale;  // t of the caller = t_scale * t of this frame; a power of two
};
using RayFrame = BasicRayFrame<float>;
using RayFrameD = BasicRayFrame<double>;

/// False for rays that are misses by definition (contract.md 3).
template <class AnyRay>
RAYDIX_HD inline bool is_valid_ray(const AnyRay& ray) {
    using Scalar = decltype(ray.tmin);
    const auto finite = [](Scalar x) { return std::fabs(x) <= std::numeric_limits<Scalar>::max(); };
    const BasicVec3<Scalar> o = ray.origin, d = ray.direction;
    return finite(o.x) && finite(o.y) && finite(o.z) && finite(d.x) && finite(d.y) && finite(d.z) &&
           (d.x != 0 || d.y != 0 || d.z != 0) && ray.tmin <= ray.tmax && ray.tmax >= 0;
}
RAYDIX_HD inline bool is_valid(const Ray& ray) { return is_valid_ray(ray); }
RAYDIX_HD inline bool is_valid(const RayD& ray) { return is_valid_ray(ray); }

/// Long or short directions are scaled by a power of two, so that no product of the triangle test
/// overflows or underflows on their account: twice an area of up to 1.6e25 times a depth of up to
/// 2e12, divided by the direction, must stay below 3.4e38. 1 for all near unit length. Others get a
/// longest component of at least 1, so that no t on the way overflows where the caller's does not,
/// unless they are subnormal.
template <class Scalar>
RAYDIX_HD inline Scalar direction_scale(Scalar longest) {
    if (longest > Scalar(0x1p-3f) && longest < Scalar(0x1p3f)) return 1;
    int exponent;
    std::frexp(longest, &exponent);
    // A subnormal direction would need more than the largest power of two that has a finite
    // inverse.
    constexpr int limit = -std::numeric_limits<Scalar>::min_exponent;
    --exponent;  // of the largest power of two that is not above
    const int limited = exponent < -limit ? -limit : exponent > limit ? limit : exponent;
    return std::ldexp(Scalar(1), -limited);
}

/// The start of a ray in units of `scale`, at least 0. One above 0 stays so: t = 0 is before it,
/// also where the quotient is less than what the type has.
template <class Scalar, class Scale>
RAYDIX_HD inline Scalar start_in_units(Scalar tmin, Scale scale) {
    if (!(tmin > 0)) return 0;
    const auto start = static_cast<Scalar>(Scale{tmin} / scale);
    return start > 0 ? start : std::numeric_limits<Scalar>::denorm_min();
}

/// `ray` must be valid.
template <class AnyRay, class Scalar = decltype(AnyRay::tmin)>
RAYDIX_HD inline BasicRayFrame<Scalar> make_frame(const AnyRay& ray) {
    BasicRayFrame<Scalar> frame;
    frame.origin = without_negative_zero(ray.origin);
    const Scalar ax = std::fabs(ray.direction.x), ay = std::fabs(ray.direction.y),
                 az = std::fabs(ray.direction.z);
    const Scalar longest = max_of(max_of(ax, ay), az);
    const Scalar scale = direction_scale(longest);
    const BasicVec3<Scalar> d = ray.direction * scale;
    frame.kz = az == longest ? 2 : ay == longest ? 1 : 0;
    frame.kx = frame.kz == 2 ? 0 : frame.kz + 1;
    frame.ky = frame.kx == 2 ? 0 : frame.kx + 1;
    if (component(d, frame.kz) < 0) {
        const int swapped = frame.kx;
        frame.kx = frame.ky;
        frame.ky = swapped;
    }
    frame.direction = d;
    const Scalar dz = component(d, frame.kz);
    frame.shear_x = component(d, frame.kx) / dz;
    frame.shear_y = component(d, frame.ky) / dz;
    const Scalar one = 1;
    frame.inverse = {one / d.x, one / d.y, one / d.z};
    frame.t_scale = scale;
    frame.tmin = start_in_units(ray.tmin, scale);
    // The caller's t is finite too: first in those units, then in these.
    constexpr Scalar most = std::numeric_limits<Scalar>::max();
    frame.tmax = min_of(min_of(ray.tmax, most) / scale, most);
    return frame;
}

}  // namespace raydix
