// Whether two triangles of small whole numbers have a point in common, by looking for a direction
// that separates them: nothing shared with the library, and no rounding.
#pragma once

#include <raydix/bvh.h>

#include <array>
#include <cstdint>
#include <vector>

namespace raydix::test {

struct WholePoint {
    std::int64_t x, y, z;
};
inline WholePoint whole(Vec3 p) {
    return {static_cast<std::int64_t>(p.x), static_cast<std::int64_t>(p.y),
            static_cast<std::int64_t>(p.z)};
}
inline WholePoint operator-(WholePoint a, WholePoint b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline WholePoint cross(WholePoint a, WholePoint b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline std::int64_t dot(WholePoint a, WholePoint b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

/// Disjoint triangles are separated by the direction in which they come closest: between two
/// corners, across an edge from a corner, across two edges, or across a face. Segments and points
/// are triangles with equal corners. Coordinates up to about 100.
inline bool whole_triangles_touch(const LeafTriangle& s, const LeafTriangle& t) {
    const std::array<WholePoint, 3> p{whole(s.v0), whole(s.v1), whole(s.v2)},
        q{whole(t.v0), whole(t.v1), whole(t.v2)};
    const auto separates = [&](WholePoint n) {
        std::array<std::int64_t, 3> a, b;
        for (std::size_t k = 0; k < 3; ++k) {
            a[k] = dot(n, p[k]);
            b[k] = dot(n, q[k]);
        }
        return std::max({a[0], a[1], a[2]}) < std::min({b[0], b[1], b[2]}) ||
               std::max({b[0], b[1], b[2]}) < std::min({a[0], a[1], a[2]});
    };
    std::vector<WholePoint> directions{cross(p[1] - p[0], p[2] - p[0]),
                                       cross(q[1] - q[0], q[2] - q[0])};
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j) {
            const WholePoint e = p[(i + 1) % 3] - p[i], f = q[(j + 1) % 3] - q[j], d = q[j] - p[i];
            directions.push_back(d);
            directions.push_back(cross(e, f));
            for (std::size_t k = 0; k < 3; ++k) {
                directions.push_back(cross(cross(e, q[k] - p[i]), e));
                directions.push_back(cross(cross(f, p[k] - q[j]), f));
            }
        }
    for (const WholePoint n : directions)
        if (separates(n)) return false;
    return true;
}

}  // namespace raydix::test
