// Arithmetic on points and boxes, for host and device. Nothing here may be contracted to FMA.
#pragma once

#include <raydix/types.h>

#include <cmath>

#include "base/hd.h"

namespace raydix {

/// contract.md 1: larger coordinates count as non-finite.
inline constexpr float max_coordinate = 1e12f;
/// contract.md 1: a box diagonal is 0 or at least this.
inline constexpr float min_diagonal = 1e-12f;

RAYDIX_HD inline Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
RAYDIX_HD inline Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
RAYDIX_HD inline Vec3 operator*(Vec3 a, float s) { return {a.x * s, a.y * s, a.z * s}; }
RAYDIX_HD inline Vec3 operator*(float s, Vec3 a) { return a * s; }
RAYDIX_HD inline Vec3d operator+(Vec3d a, Vec3d b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
RAYDIX_HD inline Vec3d operator-(Vec3d a, Vec3d b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
RAYDIX_HD inline Vec3d operator*(Vec3d a, double s) { return {a.x * s, a.y * s, a.z * s}; }
RAYDIX_HD inline Vec3d operator*(double s, Vec3d a) { return a * s; }
RAYDIX_HD inline bool operator==(Vec3 a, Vec3 b) { return a.x == b.x && a.y == b.y && a.z == b.z; }
RAYDIX_HD inline bool operator==(Vec3d a, Vec3d b) {
    return a.x == b.x && a.y == b.y && a.z == b.z;
}

RAYDIX_HD inline float dot(Vec3 a, Vec3 b) { return (a.x * b.x + a.y * b.y) + a.z * b.z; }
RAYDIX_HD inline Vec3 cross(Vec3 a, Vec3 b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// One comparison each, so that they compile to a single instruction; if either is NaN the second
// operand comes out.
RAYDIX_HD inline float min_of(float a, float b) { return a < b ? a : b; }
RAYDIX_HD inline float max_of(float a, float b) { return a > b ? a : b; }
RAYDIX_HD inline double min_of(double a, double b) { return a < b ? a : b; }
RAYDIX_HD inline double max_of(double a, double b) { return a > b ? a : b; }
RAYDIX_HD inline Vec3 min_of(Vec3 a, Vec3 b) {
    return {min_of(a.x, b.x), min_of(a.y, b.y), min_of(a.z, b.z)};
}
RAYDIX_HD inline Vec3 max_of(Vec3 a, Vec3 b) {
    return {max_of(a.x, b.x), max_of(a.y, b.y), max_of(a.z, b.z)};
}
RAYDIX_HD inline Vec3d min_of(Vec3d a, Vec3d b) {
    return {min_of(a.x, b.x), min_of(a.y, b.y), min_of(a.z, b.z)};
}
RAYDIX_HD inline Vec3d max_of(Vec3d a, Vec3d b) {
    return {max_of(a.x, b.x), max_of(a.y, b.y), max_of(a.z, b.z)};
}

/// The neutral element of `unite`.
RAYDIX_HD inline Aabb empty_box() {
    return {{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
}
RAYDIX_HD inline bool is_empty(const Aabb& b) {
    return !(b.lo.x <= b.hi.x && b.lo.y <= b.hi.y && b.lo.z <= b.hi.z);
}
RAYDIX_HD inline Aabb unite(const Aabb& a, const Aabb& b) {
    return {min_of(a.lo, b.lo), max_of(a.hi, b.hi)};
}
RAYDIX_HD inline Aabb box_of(Vec3 a, Vec3 b, Vec3 c) {
    return {min_of(min_of(a, b), c), max_of(max_of(a, b), c)};
}
RAYDIX_HD inline AabbD box_of(Vec3d a, Vec3d b, Vec3d c) {
    return {min_of(min_of(a, b), c), max_of(max_of(a, b), c)};
}

/// 0.5 * (lo + hi), as contract.md 2 has it.
RAYDIX_HD inline Vec3 center_of(const Aabb& b) { return 0.5f * (b.lo + b.hi); }

/// -0 becomes +0; everything else stays, bit for bit.
RAYDIX_HD inline Vec3 without_negative_zero(Vec3 p) { return {p.x + 0.0f, p.y + 0.0f, p.z + 0.0f}; }
RAYDIX_HD inline Vec3d without_negative_zero(Vec3d p) { return {p.x + 0.0, p.y + 0.0, p.z + 0.0}; }

/// False for NaN, Inf and |coordinate| > 1e12.
RAYDIX_HD inline bool in_range(Vec3 p) {
    const auto ok = [](float x) { return x >= -max_coordinate && x <= max_coordinate; };
    return ok(p.x) && ok(p.y) && ok(p.z);
}

/// contract.md 1: the diagonal is 0 or at least 1e-12.
RAYDIX_HD inline bool diagonal_in_range(const Aabb& box) {
    const Vec3 d = box.hi - box.lo;
    const float longest = max_of(max_of(d.x, d.y), d.z);
    if (longest >= min_diagonal || longest == 0.0f) return true;
    return std::sqrt(double(d.x) * d.x + double(d.y) * d.y + double(d.z) * d.z) >=
           double(min_diagonal);
}

/// Half the surface area in double: xy + yz + zx.
RAYDIX_HD inline double half_area(const Aabb& b) {
    const double x = double(b.hi.x) - b.lo.x, y = double(b.hi.y) - b.lo.y,
                 z = double(b.hi.z) - b.lo.z;
    return x * y + y * z + z * x;
}

}  // namespace raydix
