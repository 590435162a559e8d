// The distance of a moving point from a triangle, in rational arithmetic.
#pragma once

#include <raydix/double.h>

#include <algorithm>
#include <cmath>

#include "support/double_scenes.h"
#include "support/exact.h"

namespace raydix::test {

inline Exact exact_square_to_segment(const ExactPoint& a, const ExactPoint& b,
                                     const ExactPoint& q) {
    const ExactPoint along = b - a, off = q - a;
    const Exact length2 = dot(along, along);
    Exact s = length2 > 0 ? Exact(dot(off, along) / length2) : Exact(0);
    s = s < 0 ? Exact(0) : s > 1 ? Exact(1) : s;
    const ExactPoint rest{off.x - s * along.x, off.y - s * along.y, off.z - s * along.z};
    return dot(rest, rest);
}

/// The distance from the center at `t`, which is not rounded, to the triangle, which may have no
/// area.
inline double exact_distance(const LeafTriangleD& triangle, const RayD& path, double t) {
    const ExactPoint o = exact(path.origin), d = exact(path.direction), a = exact(triangle.v0),
                     b = exact(triangle.v1), c = exact(triangle.v2);
    const ExactPoint q{o.x + Exact(t) * d.x, o.y + Exact(t) * d.y, o.z + Exact(t) * d.z};
    const ExactPoint n = cross(b - a, c - a);
    const Exact n2 = dot(n, n), height = dot(n, q - a);
    const bool inside = n2 > 0 && dot(cross(b - a, q - a), n) >= 0 &&
                        dot(cross(c - b, q - b), n) >= 0 && dot(cross(a - c, q - c), n) >= 0;
    const Exact square =
        inside ? Exact(height * height / n2)
               : std::min({exact_square_to_segment(a, b, q), exact_square_to_segment(b, c, q),
                           exact_square_to_segment(c, a, q)});
    return std::sqrt(static_cast<double>(square));
}

}  // namespace raydix::test
