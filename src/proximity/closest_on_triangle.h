// The point of a triangle that is closest to a query: one pure function of float32 inputs, called
// by every walk and by brute force. In double inside, because slivers and huge triangles leave
// nothing of a float32 normal. The same for inputs in double, with more care for slivers.
//
// Vec: Vec3 or Vec3d; Corners: LeafTriangle or LeafTriangleD.
#pragma once

#include <raydix/bvh.h>
#include <raydix/double.h>
#include <raydix/types.h>

#include <cmath>

#include "base/distance.h"
#include "base/double3.h"
#include "base/hd.h"
#include "base/math.h"
#include "base/scalar.h"

namespace raydix {

/// Square of the distance to a box. Each |p - q| with p in the box is at least `off` after
/// rounding, squares and sums are monotone: never greater than squared_distance(p, q).
RAYDIX_HD inline float squared_distance_to_box(const Aabb& box, Vec3 q) {
    const Vec3 off = max_of(max_of(box.lo - q, q - box.hi), Vec3{0.0f, 0.0f, 0.0f});
    return (off.x * off.x + off.y * off.y) + off.z * off.z;
}
inline double squared_distance_to_box(const AabbD& box, Vec3d q) {
    const Vec3d off = max_of(max_of(box.lo - q, q - box.hi), Vec3d{0.0, 0.0, 0.0});
    return (off.x * off.x + off.y * off.y) + off.z * off.z;
}

template <class Scalar>
struct BasicTrianglePoint {
    BasicVec3<Scalar> position;
    Scalar u, v;  // weights of v1 and v2
    Scalar d2;
};
using TrianglePoint = BasicTrianglePoint<float>;
using TrianglePointD = BasicTrianglePoint<double>;

/// A candidate in double.
struct CandidatePoint {
    Double3 position;
    double u, v, d2;
};

template <class Vec>
RAYDIX_HD inline bool comes_first(Vec a, Vec b) {
    return a.x != b.x ? a.x < b.x : a.y != b.y ? a.y < b.y : a.z < b.z;
}

/// The closest point of segment a, b, and in `s` the weight of b. The ends are put in order first,
/// so that two triangles get the same bits on the edge that they share: such ties go to the lower
/// id.
template <class Vec>
RAYDIX_HD inline Double3 closest_on_segment(Vec a, Vec b, Double3 query, double& s) {
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
template <class Corners>
RAYDIX_HD inline CandidatePoint closest_on_outline(const Corners& t, Double3 query) {
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

/// a x b with little more than one rounding in each component (Kahan's difference of products;
/// Jeannerod, Louvet, Muller, "Further analysis of Kahan's algorithm", 2013).
RAYDIX_HD inline Double3 accurate_cross(Double3 a, Double3 b) {
    const auto difference = [](double p, double q, double r, double s) {
        const double rs = r * s;
        return std::fma(p, q, -rs) + std::fma(-r, s, rs);
    };
    return {difference(a.y, b.z, a.z, b.y), difference(a.z, b.x, a.x, b.z),
            difference(a.x, b.y, a.y, b.x)};
}

template <bool accurate>
RAYDIX_HD inline Double3 cross_of(Double3 a, Double3 b) {
    if constexpr (accurate)
        return accurate_cross(a, b);
    else
        return cross(a, b);
}

/// The query's foot on the plane with this normal, which is not 0; false if it is outside of the
/// triangle, or if rounding leaves nothing of its weights.
template <bool accurate = false, class Corners>
RAYDIX_HD inline bool foot_on_plane(const Corners& t, Double3 query, Double3 normal,
                                    CandidatePoint& foot) {
    const Double3 a(t.v0), b(t.v1), c(t.v2);
    const Double3 ab = b - a, ac = c - a, bc = c - b;
    const double u = dot(cross_of<accurate>(query - a, ac), normal),
                 v = dot(cross_of<accurate>(ab, query - a), normal),
                 w = dot(cross_of<accurate>(bc, query - b), normal);
    const double sum = (u + v) + w;
    if (!(u >= 0.0 && v >= 0.0 && w >= 0.0 && sum > 0.0)) return false;
    const double weight_b = u / sum, weight_c = v / sum;
    foot = {a + ab * weight_b + ac * weight_c, weight_b, weight_c, 0.0};
    return true;
}

/// A triangle thinner than this part of its length, squared, is its outline: no point of it is
/// farther from that than float32 can tell.
inline constexpr double outline_only = 0x1p-80;

RAYDIX_HD inline CandidatePoint closest_candidate(const LeafTriangle& t, Double3 query) {
    const Double3 a(t.v0), ab = Double3(t.v1) - a, ac = Double3(t.v2) - a;
    const Double3 normal = cross(ab, ac);
    CandidatePoint best;
    if (dot(normal, normal) > outline_only * dot(ab, ab) * dot(ac, ac) &&
        foot_on_plane(t, query, normal, best))
        return best;
    return closest_on_outline(t, query);
}

/// In double a sliver's foot and its outline both compete: near its plane the foot is right, far
/// from it, where a weak normal moves the foot, the outline is as near.
inline CandidatePoint closest_on_sliver(const LeafTriangleD& t, Double3 query) {
    const Double3 a(t.v0);
    const Double3 normal = accurate_cross(Double3(t.v1) - a, Double3(t.v2) - a);
    CandidatePoint best = closest_on_outline(t, query), foot;
    if (dot(normal, normal) > 0.0 && foot_on_plane<true>(t, query, normal, foot))
        offer(best, foot.position, foot.u, foot.v, query);
    return best;
}

inline CandidatePoint closest_candidate(const LeafTriangleD& t, Double3 query) {
    constexpr double sliver = 0x1p-40;
    const Double3 a(t.v0), ab = Double3(t.v1) - a, ac = Double3(t.v2) - a;
    const Double3 normal = cross(ab, ac);
    if (!(dot(normal, normal) > sliver * dot(ab, ab) * dot(ac, ac)))
        return closest_on_sliver(t, query);
    CandidatePoint best;
    return foot_on_plane(t, query, normal, best) ? best : closest_on_outline(t, query);
}

/// The query's foot on the triangle's plane if it lies inside, else the closest point of the
/// outline.
template <class Corners, class Vec>
RAYDIX_HD inline auto closest_on_triangle(const Corners& t, Vec q) {
    using Scalar = decltype(q.x);
    const CandidatePoint best = closest_candidate(t, Double3(q));
    // Rounding must not carry the point out of the boxes that the tree has around the triangle.
    const BasicAabb<Scalar> box = box_of(t.v0, t.v1, t.v2);
    Vec position;
    best.position.round_to(position);
    position = without_negative_zero(min_of(max_of(position, box.lo), box.hi));
    return BasicTrianglePoint<Scalar>{position, static_cast<Scalar>(best.u),
                                      static_cast<Scalar>(best.v), squared_distance(position, q)};
}

}  // namespace raydix
