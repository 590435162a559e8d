// Points and directions in double, where float32 would lose too much: camera frames, normals, hit
// points.
#pragma once

#include <raydix/types.h>

#include <cmath>

#include "base/hd.h"

namespace raydix {

struct Double3 {
    double x = 0.0, y = 0.0, z = 0.0;

    Double3() = default;
    RAYDIX_HD Double3(double x_value, double y_value, double z_value)
        : x(x_value), y(y_value), z(z_value) {}
    RAYDIX_HD explicit Double3(Vec3 p) : x(p.x), y(p.y), z(p.z) {}
    RAYDIX_HD explicit Double3(Vec3d p) : x(p.x), y(p.y), z(p.z) {}

    [[nodiscard]] RAYDIX_HD Vec3 rounded() const {
        return {static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
    }
    RAYDIX_HD void round_to(Vec3& p) const { p = rounded(); }
    RAYDIX_HD void round_to(Vec3d& p) const { p = {x, y, z}; }
};

RAYDIX_HD inline Double3 operator+(Double3 a, Double3 b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}
RAYDIX_HD inline Double3 operator-(Double3 a, Double3 b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
RAYDIX_HD inline Double3 operator*(Double3 a, double s) { return {a.x * s, a.y * s, a.z * s}; }

RAYDIX_HD inline double dot(Double3 a, Double3 b) { return (a.x * b.x + a.y * b.y) + a.z * b.z; }
RAYDIX_HD inline Double3 cross(Double3 a, Double3 b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
RAYDIX_HD inline double length(Double3 a) { return std::sqrt(dot(a, a)); }
RAYDIX_HD inline Double3 normalized(Double3 a) { return a * (1.0 / length(a)); }
inline bool is_finite(Double3 a) {
    return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z);
}

/// Length of the box's diagonal; 0 if the box is empty.
RAYDIX_HD inline double diagonal_of(const Aabb& box) {
    if (!(box.lo.x <= box.hi.x && box.lo.y <= box.hi.y && box.lo.z <= box.hi.z)) return 0.0;
    return length(Double3(box.hi) - Double3(box.lo));
}

}  // namespace raydix
