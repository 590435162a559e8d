// exact_sign.h for points in double: a filter with a bound on its error decides nearly always
// (Shewchuk 1997, section 4); where it does not, a sum of exact products, each from FMA without an
// error. For coordinates up to 1e12 in magnitude that are 0 or at least 2^-500, so that no product
// overflows or underflows.
#pragma once

#include <raydix/types.h>

#include <cmath>

#include "base/exact_sign.h"

namespace raydix {

/// contract.md 1: -0 becomes +0. So does what is too small for exact products of three; NaN stays.
inline double without_tiny(double x) { return std::fabs(x) < 0x1p-500 ? 0.0 : x; }
inline Vec3d without_tiny(Vec3d p) {
    return {without_tiny(p.x), without_tiny(p.y), without_tiny(p.z)};
}

struct Point2d {
    double x, y;
};

/// Products of doubles, added without an error.
class ExactSumD : public BasicExactSum<104> {
public:
    /// Every factor is moved up first: the last digits of products of tiny ones would be lost.
    static constexpr double unit = 0x1p280;

    void add_product(double x, double y) { add_scaled(unit * x, unit * y); }
    void add_product(double x, double y, double z) {
        const double a = unit * x, b = unit * y, c = unit * z;
        const double ab = a * b;
        add_scaled(ab, c);
        add_scaled(std::fma(a, b, -ab), c);
    }

private:
    void add_scaled(double x, double y) {
        const double product = x * y;
        add(product);
        add(std::fma(x, y, -product));
    }
};

inline int exact_turn_sign(Point2d a, Point2d b, Point2d c) {
    ExactSumD sum;
    sum.add_product(a.x, b.y);
    sum.add_product(-a.y, b.x);
    sum.add_product(b.x, c.y);
    sum.add_product(-b.y, c.x);
    sum.add_product(c.x, a.y);
    sum.add_product(-c.y, a.x);
    return sum.sign();
}

/// As turn_sign of floats.
inline int turn_sign(Point2d a, Point2d b, Point2d c) {
    const double left = (a.x - c.x) * (b.y - c.y), right = (a.y - c.y) * (b.x - c.x);
    const double det = left - right;
    const double bound = 3.3306690738754716e-16 * (std::fabs(left) + std::fabs(right)) + 0x1p-1000;
    if (det > bound || det < -bound) return det > 0.0 ? 1 : -1;
    // Along an axis, as so much in the world of buildings is.
    if ((a.x == c.x && b.x == c.x) || (a.y == c.y && b.y == c.y)) return 0;
    return exact_turn_sign(a, b, c);
}

inline void add_determinant(ExactSumD& sum, double sign, Vec3d p, Vec3d q, Vec3d r) {
    sum.add_product(sign * p.x, q.y, r.z);
    sum.add_product(-sign * p.x, q.z, r.y);
    sum.add_product(sign * p.y, q.z, r.x);
    sum.add_product(-sign * p.y, q.x, r.z);
    sum.add_product(sign * p.z, q.x, r.y);
    sum.add_product(-sign * p.z, q.y, r.x);
}

inline int exact_side_of_plane(Vec3d a, Vec3d b, Vec3d c, Vec3d d) {
    ExactSumD sum;  // det(b, c, d) - det(a, c, d) + det(a, b, d) - det(a, b, c), turned
    add_determinant(sum, 1.0, b, c, d);
    add_determinant(sum, -1.0, a, c, d);
    add_determinant(sum, 1.0, a, b, d);
    add_determinant(sum, -1.0, a, b, c);
    return sum.sign();
}

/// As side_of_plane of floats.
inline int side_of_plane(Vec3d a, Vec3d b, Vec3d c, Vec3d d) {
    const double ax = a.x - d.x, ay = a.y - d.y, az = a.z - d.z;
    const double bx = b.x - d.x, by = b.y - d.y, bz = b.z - d.z;
    const double cx = c.x - d.x, cy = c.y - d.y, cz = c.z - d.z;
    const double bxcy = bx * cy, cxby = cx * by, cxay = cx * ay, axcy = ax * cy, axby = ax * by,
                 bxay = bx * ay;
    const double det = az * (bxcy - cxby) + bz * (cxay - axcy) + cz * (axby - bxay);
    const double size = (std::fabs(bxcy) + std::fabs(cxby)) * std::fabs(az) +
                        (std::fabs(cxay) + std::fabs(axcy)) * std::fabs(bz) +
                        (std::fabs(axby) + std::fabs(bxay)) * std::fabs(cz);
    const double bound = 7.7715611723761027e-16 * size + 0x1p-900;
    if (det > bound || det < -bound) return det > 0.0 ? -1 : 1;
    if ((ax == 0 && bx == 0 && cx == 0) || (ay == 0 && by == 0 && cy == 0) ||
        (az == 0 && bz == 0 && cz == 0))
        return 0;
    return exact_side_of_plane(a, b, c, d);
}

}  // namespace raydix
