// The closest point of a triangle as users of Embree write it for rtcPointQuery; in double it is
// the reference for both sides.
#pragma once

#include "base/math.h"

namespace raydix::bench {

template <class Vec>
auto inner_product(Vec a, Vec b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

/// By the region that q falls into (Ericson, Real-Time Collision Detection, 5.1.5). Triangles
/// without area count as their edges. Vec: Vec3 or Vec3d.
template <class Vec>
Vec point_of_triangle(Vec a, Vec b, Vec c, Vec q) {
    using Scalar = decltype(q.x);
    const auto along = [](Vec from, Vec edge, Scalar reach, Scalar rest) {
        return reach + rest > 0 ? from + (reach / (reach + rest)) * edge : from;
    };
    const Vec ab = b - a, ac = c - a, aq = q - a;
    const Scalar d1 = inner_product(ab, aq), d2 = inner_product(ac, aq);
    if (d1 <= 0 && d2 <= 0) return a;
    const Vec bq = q - b;
    const Scalar d3 = inner_product(ab, bq), d4 = inner_product(ac, bq);
    if (d3 >= 0 && d4 <= d3) return b;
    const Vec cq = q - c;
    const Scalar d5 = inner_product(ab, cq), d6 = inner_product(ac, cq);
    if (d6 >= 0 && d5 <= d6) return c;
    const Scalar vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0 && d1 - d3 > 0) return along(a, ab, d1, -d3);
    const Scalar vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0) return along(a, ac, d2, -d6);
    const Scalar va = d3 * d6 - d5 * d4;
    if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) return along(b, c - b, d4 - d3, d5 - d6);
    const Scalar part = 1 / (va + vb + vc);
    return a + (vb * part) * ab + (vc * part) * ac;
}

}  // namespace raydix::bench
