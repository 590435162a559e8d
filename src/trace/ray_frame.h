// What a ray's tests share, computed once per ray: validity, scale, the shear of the watertight
// triangle test (Woop, Benthin, Wald 2013, section 3) and reciprocals for slabs. A pure function of
// the ray.
#pragma once

#include <raydix/types.h>

#include <cmath>
#include <limits>

#include "base/hd.h"
#include "base/math.h"

namespace raydix {

RAYDIX_HD inline float component(Vec3 v, int axis) {
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

struct RayFrame {
    Vec3 origin;
    Vec3 inverse;    // 1 / direction; Inf for components of 0, with their sign
    int kx, ky, kz;  // kz: the longest axis of the direction; kx, ky keep the winding
    float shear_x, shear_y, shear_z;
    float tmin, tmax;  // in units of the scaled direction, within [0, largest float]
    float t_scale;     // t of the caller = t_scale * t of this frame; a power of two
};

/// False for rays that are misses by definition (contract.md 3).
RAYDIX_HD inline bool is_valid(const Ray& ray) {
    const auto finite = [](float x) { return std::fabs(x) <= std::numeric_limits<float>::max(); };
    const Vec3 o = ray.origin, d = ray.direction;
    return finite(o.x) && finite(o.y) && finite(o.z) && finite(d.x) && finite(d.y) && finite(d.z) &&
           (d.x != 0.0f || d.y != 0.0f || d.z != 0.0f) && ray.tmin <= ray.tmax && ray.tmax >= 0.0f;
}

/// Long or short directions are scaled by a power of two, so that no product of the triangle test
/// overflows or underflows on their account: twice an area of up to 1.6e25 times a depth of up to
/// 2e12, divided by the direction, must stay below 3.4e38. 1 for all near unit length.
RAYDIX_HD inline float direction_scale(float longest) {
    if (longest > 0x1p-3f && longest < 0x1p3f) return 1.0f;
    int exponent;
    std::frexp(longest, &exponent);
    // A subnormal direction would need more than the largest power of two that has a finite
    // inverse.
    const int limited = exponent < -125 ? -125 : exponent > 125 ? 125 : exponent;
    return std::ldexp(1.0f, -limited);
}

/// `ray` must be valid.
RAYDIX_HD inline RayFrame make_frame(const Ray& ray) {
    RayFrame frame;
    frame.origin = without_negative_zero(ray.origin);
    const float ax = std::fabs(ray.direction.x), ay = std::fabs(ray.direction.y),
                az = std::fabs(ray.direction.z);
    const float longest = max_of(max_of(ax, ay), az);
    const float scale = direction_scale(longest);
    const Vec3 d = ray.direction * scale;
    frame.kz = az == longest ? 2 : ay == longest ? 1 : 0;
    frame.kx = frame.kz == 2 ? 0 : frame.kz + 1;
    frame.ky = frame.kx == 2 ? 0 : frame.kx + 1;
    if (component(d, frame.kz) < 0.0f) {
        const int swapped = frame.kx;
        frame.kx = frame.ky;
        frame.ky = swapped;
    }
    const float dz = component(d, frame.kz);
    frame.shear_x = component(d, frame.kx) / dz;
    frame.shear_y = component(d, frame.ky) / dz;
    frame.shear_z = 1.0f / dz;
    frame.inverse = {1.0f / d.x, 1.0f / d.y, 1.0f / d.z};
    frame.t_scale = scale;
    frame.tmin = (ray.tmin > 0.0f ? ray.tmin : 0.0f) / scale;
    frame.tmax = min_of(ray.tmax / scale, std::numeric_limits<float>::max());
    return frame;
}

}  // namespace raydix
