// When two tracers report the same distance.
#pragma once

#include <raydix/types.h>

#include <algorithm>
#include <cmath>

namespace raydix::bench {

/// Of the numbers that a distance along `ray` is computed from.
inline double scale_of(const Ray& ray, float t) {
    const Vec3& o = ray.origin;
    return std::max({std::abs(o.x), std::abs(o.y), std::abs(o.z), std::abs(t)});
}

/// Float32 coordinates carry no more digits than their size allows, so a distance is compared by
/// the greater of itself and the origin's largest coordinate.
inline bool far_apart(const Ray& ray, float t, float u, double tolerance) {
    return std::abs(double(t) - double(u)) > tolerance * scale_of(ray, t);
}

}  // namespace raydix::bench
