// The point of a triangle that is closest to a query: one pure function of float32 inputs, called
// by every walk and by brute force. In double inside, because slivers and huge triangles leave
// nothing of a float32 normal.
#pragma once

#include <raydix/bvh.h>
#include <raydix/types.h>

#include "base/double3.h"
#include "base/hd.h"
#include "base/math.h"

namespace raydix {

/// As contract.md 8 has it.
RAYDIX_HD inline float squared_distance(Vec3 a, Vec3 b) {
    const float dx = a.x - b.x, dy = a.y - b.y, dz = a.z - b.z;
    return (dx * dx + dy * dy) + dz * dz;
}

/// Square of the distance to a box. Each |p - q| with p in the box is at least `off` after
/// rounding, squares and sums are monotone: never greater than squared_distance(p, q).
RAYDIX_HD inline float squared_distance_to_box(const Aabb& box, Vec3 q) {
    const Vec3 off = max_of(max_of(box.lo - q, q - box.hi), Vec3{0.0f, 0.0f, 0.0f});
    return (off.x * off.x + off.y * off.y) + off.z * off.z;
}

struct TrianglePoint {
    Vec3 position;
    float u, v;  // weights of v1 and v2
    float d2;
};

/// A candidate in double.
struct CandidatePoint {
    Double3 position;
    double u, v, d2;
};

RAYDIX_HD inline bool comes_first(Vec3 a, Vec3 b) {
    return a.x != b.x ? a.x < b.x : a.y != b.y ? a.y < b.y : a.z < b.z;
}

/// The closest point of segment a, b, and in `s` the weight of b. The ends are put in order first,
/// so that two triangles get the same bits on the edge that they share: such ties go to the lower
/// id.
RAYDIX_HD inline Double3 closest_on_segment(Vec3 a, Vec3 b, Double3 query, double& s) {
    const bool swapped = comes_first(b, a);
    const Double3 from(swapped ? b : a), to(swapped ? a : b);
    const Double3 along = to - from;
    const double length2 = dot(along, along), reach = dot(query - from, along);
    const double t = reach > 0.0 ? (reach < length2 ? reach / length2 : 1.0) : 0.0;
    s = swapped ? 1.0 - t : t;
    // Ends come out as they went in.
    return t == 0.0 ? from : t == 1.0 ? to : from + along * t;
}

/// Keeps the closer one.
RAYDIX_HD inline void offer(CandidatePoint& best, Double3 position, double u, double v,
                            Double3 query) {
    const Double3 off = position - query;
    const double d2 = dot(off, off);
    if (d2 < best.d2) best = {position, u, v, d2};
}

/// The least of three segments.
RAYDIX_HD inline CandidatePoint closest_on_outline(const LeafTriangle& t, Double3 query) {
    double s;
    const Double3 on_ab = closest_on_segment(t.v0, t.v1, query, s);
    const Double3 off = on_ab - query;
    CandidatePoint best{on_ab, s, 0.0, dot(off, off)};
    const Double3 on_bc = closest_on_segment(t.v1, t.v2, query, s);
    offer(best, on_bc, 1.0 - s, s, query);
    const Double3 on_ca = closest_on_segment(t.v2, t.v0, query, s);
    offer(best, on_ca, 0.0, 1.0 - s, query);
    return best;
}

/// The query's foot on the triangle's plane if it lies inside, else the closest point of the
/// outline. A triangle thinner than 2^-40 of its length is its outline: no point of it is farther
/// from that than float32 can tell.
RAYDIX_HD inline TrianglePoint closest_on_triangle(const LeafTriangle& t, Vec3 q) {
    const Double3 query(q), a(t.v0), b(t.v1), c(t.v2);
    const Double3 ab = b - a, ac = c - a, bc = c - b;
    const Double3 normal = cross(ab, ac);
    const double area2 = dot(normal, normal);
    CandidatePoint best;
    const double u = dot(cross(query - a, ac), normal), v = dot(cross(ab, query - a), normal),
                 w = dot(cross(bc, query - b), normal);
    if (u >= 0.0 && v >= 0.0 && w >= 0.0 && area2 > 0x1p-80 * dot(ab, ab) * dot(ac, ac)) {
        const double sum = (u + v) + w;
        const double weight_b = u / sum, weight_c = v / sum;
        best = {a + ab * weight_b + ac * weight_c, weight_b, weight_c, 0.0};
    } else {
        best = closest_on_outline(t, query);
    }
    // Rounding must not carry the point out of the boxes that the tree has around the triangle.
    const Aabb box = box_of(t.v0, t.v1, t.v2);
    const Vec3 position =
        without_negative_zero(min_of(max_of(best.position.rounded(), box.lo), box.hi));
    return {position, static_cast<float>(best.u), static_cast<float>(best.v),
            squared_distance(position, q)};
}

}  // namespace raydix
