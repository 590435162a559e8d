// Signs of determinants of float32 points, without any rounding: on which side of a line or of a
// plane a point lies. First in double with a bound on the error (Shewchuk, "Adaptive precision
// floating-point arithmetic and fast robust geometric predicates", 1997, section 4); where that
// does not decide, as a sum of exact products.
#pragma once

#include <raydix/types.h>

#include <cmath>

#include "base/check.h"
#include "base/hd.h"

namespace raydix {

/// The exact sum of up to `capacity` doubles, as parts that do not overlap, smallest first
/// (Shewchuk 1997, figure 6, grow-expansion without zeros).
template <int capacity>
class BasicExactSum {
public:
    RAYDIX_HD void add(double term) {
        int kept = 0;
        for (int i = 0; i < size_; ++i) {
            const double sum = term + parts_[i];
            const double from_part = sum - term;
            const double error = (term - (sum - from_part)) + (parts_[i] - from_part);
            if (error != 0.0) parts_[kept++] = error;
            term = sum;
        }
        if (term != 0.0) parts_[kept++] = term;
        size_ = kept;
        RAYDIX_CHECK(size_, <=, capacity);
    }
    [[nodiscard]] RAYDIX_HD int sign() const {
        return size_ == 0 ? 0 : parts_[size_ - 1] > 0.0 ? 1 : -1;
    }

private:
    double parts_[capacity];
    int size_ = 0;
};

class ExactSum : public BasicExactSum<48> {
public:
    /// Adds x * y * z of floats. x * y has at most 48 bits, exact in double; its two halves times z
    /// are exact too.
    RAYDIX_HD void add_product(float x, float y, float z) {
        const double xy = double(x) * y;
        const double scaled = 134217729.0 * xy;  // 2^27 + 1 (Veltkamp)
        const double high = scaled - (scaled - xy);
        add(high * z);
        add((xy - high) * z);
    }
};

RAYDIX_HD inline int sign_of(double x) { return x > 0.0 ? 1 : x < 0.0 ? -1 : 0; }

/// A point of a coordinate plane.
struct Point2 {
    float x, y;
};

/// 1 if a, b, c turn counter-clockwise, -1 if clockwise, 0 if they are on one line. Exact for all
/// finite floats.
RAYDIX_HD inline int turn_sign(Point2 a, Point2 b, Point2 c) {
    const double left = (double(a.x) - c.x) * (double(b.y) - c.y);
    const double right = (double(a.y) - c.y) * (double(b.x) - c.x);
    const double det = left - right;
    const double bound = 3.3306690738754716e-16 * (std::fabs(left) + std::fabs(right));
    if (det > bound || det < -bound) return det > 0.0 ? 1 : -1;
    if (bound == 0.0) return 0;
    ExactSum sum;
    sum.add(double(a.x) * b.y);
    sum.add(-double(a.y) * b.x);
    sum.add(double(b.x) * c.y);
    sum.add(-double(b.y) * c.x);
    sum.add(double(c.x) * a.y);
    sum.add(-double(c.y) * a.x);
    return sum.sign();
}

/// Adds sign * det(p, q, r).
RAYDIX_HD inline void add_determinant(ExactSum& sum, float sign, Vec3 p, Vec3 q, Vec3 r) {
    sum.add_product(sign * p.x, q.y, r.z);
    sum.add_product(-sign * p.x, q.z, r.y);
    sum.add_product(sign * p.y, q.z, r.x);
    sum.add_product(-sign * p.y, q.x, r.z);
    sum.add_product(sign * p.z, q.x, r.y);
    sum.add_product(-sign * p.z, q.y, r.x);
}

/// The sign of (b - a) x (c - a) . (d - a): 1 if d is on the side of the plane through a, b, c from
/// which they turn counter-clockwise, -1 on the other, 0 in the plane or if a, b, c are on one
/// line. Exact for all finite floats.
RAYDIX_HD inline int side_of_plane(Vec3 a, Vec3 b, Vec3 c, Vec3 d) {
    const double ax = double(a.x) - d.x, ay = double(a.y) - d.y, az = double(a.z) - d.z;
    const double bx = double(b.x) - d.x, by = double(b.y) - d.y, bz = double(b.z) - d.z;
    const double cx = double(c.x) - d.x, cy = double(c.y) - d.y, cz = double(c.z) - d.z;
    const double bxcy = bx * cy, cxby = cx * by, cxay = cx * ay, axcy = ax * cy, axby = ax * by,
                 bxay = bx * ay;
    const double det = az * (bxcy - cxby) + bz * (cxay - axcy) + cz * (axby - bxay);
    const double size = (std::fabs(bxcy) + std::fabs(cxby)) * std::fabs(az) +
                        (std::fabs(cxay) + std::fabs(axcy)) * std::fabs(bz) +
                        (std::fabs(axby) + std::fabs(bxay)) * std::fabs(cz);
    const double bound = 7.7715611723761027e-16 * size;
    if (det > bound || det < -bound) return det > 0.0 ? -1 : 1;
    if (bound == 0.0) return 0;
    ExactSum sum;  // det(b, c, d) - det(a, c, d) + det(a, b, d) - det(a, b, c), turned
    add_determinant(sum, 1.0f, b, c, d);
    add_determinant(sum, -1.0f, a, c, d);
    add_determinant(sum, 1.0f, a, b, d);
    add_determinant(sum, -1.0f, a, b, c);
    return sum.sign();
}

}  // namespace raydix
