// Distance from a point to a triangle by another algorithm than the library's, in long double.
#pragma once

#include <raydix/bvh.h>

#include <cmath>

namespace raydix::test {

/// Distance to a triangle by the regions of Ericson (Real-Time Collision Detection, 2005, section
/// 5.1.5), in long double.
inline long double region_distance(const LeafTriangle& t, Vec3 query) {
    using Real = long double;
    struct P {
        Real x, y, z;
    };
    const auto load = [](Vec3 v) { return P{v.x, v.y, v.z}; };
    const auto sub = [](P a, P b) { return P{a.x - b.x, a.y - b.y, a.z - b.z}; };
    const auto dot = [](P a, P b) { return a.x * b.x + a.y * b.y + a.z * b.z; };
    const auto along = [](P a, P d, Real s) {
        return P{a.x + s * d.x, a.y + s * d.y, a.z + s * d.z};
    };
    const P a = load(t.v0), b = load(t.v1), c = load(t.v2), p = load(query);
    const P ab = sub(b, a), ac = sub(c, a), ap = sub(p, a), bp = sub(p, b), cp = sub(p, c);
    const auto far = [&](P at) { return std::sqrt(dot(sub(at, p), sub(at, p))); };
    const Real d1 = dot(ab, ap), d2 = dot(ac, ap), d3 = dot(ab, bp), d4 = dot(ac, bp),
               d5 = dot(ab, cp), d6 = dot(ac, cp);
    if (d1 <= 0 && d2 <= 0) return far(a);
    if (d3 >= 0 && d4 <= d3) return far(b);
    const Real vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) return far(along(a, ab, d1 / (d1 - d3)));
    if (d6 >= 0 && d5 <= d6) return far(c);
    const Real vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0) return far(along(a, ac, d2 / (d2 - d6)));
    const Real va = d3 * d6 - d5 * d4;
    if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0)
        return far(along(b, sub(c, b), (d4 - d3) / ((d4 - d3) + (d5 - d6))));
    const Real sum = va + vb + vc;
    return far(along(along(a, ab, vb / sum), ac, vc / sum));
}

}  // namespace raydix::test
