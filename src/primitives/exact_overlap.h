// Whether triangles, segments and points have a point in common: closed sets, decided without
// rounding for all finite floats, and for doubles within the range of exact_sign_double.h, so that
// the answer does not depend on the order of the arguments or of their corners. Triangles without
// area count as the segments or points that they are.
//
// Vec: Vec3 or Vec3d; Point: Point2 or Point2d; Corners: LeafTriangle or LeafTriangleD.
#pragma once

#include <raydix/bvh.h>
#include <raydix/types.h>

#include "base/exact_sign.h"
#include "base/exact_sign_double.h"
#include "base/hd.h"
#include "base/math.h"

namespace raydix {

/// The point without its coordinate `axis`.
RAYDIX_HD inline Point2 drop_axis(Vec3 p, int axis) {
    return axis == 0 ? Point2{p.y, p.z} : axis == 1 ? Point2{p.z, p.x} : Point2{p.x, p.y};
}
inline Point2d drop_axis(Vec3d p, int axis) {
    return axis == 0 ? Point2d{p.y, p.z} : axis == 1 ? Point2d{p.z, p.x} : Point2d{p.x, p.y};
}

template <class Box>
RAYDIX_HD inline bool boxes_touch(const Box& a, const Box& b) {
    return a.lo.x <= b.hi.x && b.lo.x <= a.hi.x && a.lo.y <= b.hi.y && b.lo.y <= a.hi.y &&
           a.lo.z <= b.hi.z && b.lo.z <= a.hi.z;
}
RAYDIX_HD inline Aabb segment_box(Vec3 p, Vec3 q) { return {min_of(p, q), max_of(p, q)}; }
inline AabbD segment_box(Vec3d p, Vec3d q) { return {min_of(p, q), max_of(p, q)}; }

/// An axis along which the triangle's projection keeps an area; 3 if it has none.
template <class Vec>
RAYDIX_HD inline int projection_axis(Vec a, Vec b, Vec c) {
    for (int axis = 0; axis < 3; ++axis)
        if (turn_sign(drop_axis(a, axis), drop_axis(b, axis), drop_axis(c, axis)) != 0) return axis;
    return 3;
}

/// Closed segments in a plane.
template <class Point>
RAYDIX_HD inline bool segments_touch_2d(Point p, Point q, Point a, Point b) {
    const auto between = [](auto x, auto y, auto at) {
        return min_of(x, y) <= at && at <= max_of(x, y);
    };
    const auto on_segment = [&](Point s, Point e, Point at) {
        return between(s.x, e.x, at.x) && between(s.y, e.y, at.y);
    };
    const int pa = turn_sign(p, q, a), pb = turn_sign(p, q, b), ap = turn_sign(a, b, p),
              aq = turn_sign(a, b, q);
    if (pa * pb < 0 && ap * aq < 0) return true;
    return (pa == 0 && on_segment(p, q, a)) || (pb == 0 && on_segment(p, q, b)) ||
           (ap == 0 && on_segment(a, b, p)) || (aq == 0 && on_segment(a, b, q));
}

/// Closed segments in space; either may be a point.
template <class Vec>
RAYDIX_HD inline bool segments_touch(Vec p, Vec q, Vec a, Vec b) {
    if (!boxes_touch(segment_box(p, q), segment_box(a, b))) return false;
    if (side_of_plane(p, q, a, b) != 0) return false;
    // All four are in one plane; a projection that keeps any three of them apart keeps all apart.
    for (int axis = 0; axis < 3; ++axis) {
        const auto u = drop_axis(p, axis), v = drop_axis(q, axis), w = drop_axis(a, axis),
                   x = drop_axis(b, axis);
        if (turn_sign(u, v, w) != 0 || turn_sign(u, v, x) != 0 || turn_sign(w, x, u) != 0 ||
            turn_sign(w, x, v) != 0)
            return segments_touch_2d(u, v, w, x);
    }
    return true;  // on one line, and their boxes touch
}

/// A point in the triangle's plane against the closed triangle, both projected along `axis`.
template <class Point>
RAYDIX_HD inline bool point_in_triangle_2d(Point p, Point a, Point b, Point c) {
    const int ab = turn_sign(a, b, p), bc = turn_sign(b, c, p), ca = turn_sign(c, a, p);
    return (ab >= 0 && bc >= 0 && ca >= 0) || (ab <= 0 && bc <= 0 && ca <= 0);
}

/// Segment and triangle of one plane; `axis` from projection_axis.
template <class Vec, class Corners>
RAYDIX_HD inline bool coplanar_touch(Vec p, Vec q, const Corners& t, int axis) {
    const auto u = drop_axis(p, axis), v = drop_axis(q, axis), a = drop_axis(t.v0, axis),
               b = drop_axis(t.v1, axis), c = drop_axis(t.v2, axis);
    return point_in_triangle_2d(u, a, b, c) || point_in_triangle_2d(v, a, b, c) ||
           segments_touch_2d(u, v, a, b) || segments_touch_2d(u, v, b, c) ||
           segments_touch_2d(u, v, c, a);
}

/// For a segment whose ends are on the sides `side_p` and `side_q` of the triangle's plane.
template <class Vec, class Corners>
RAYDIX_HD inline bool segment_touches(Vec p, Vec q, const Corners& t, int side_p, int side_q) {
    if (side_p * side_q > 0) return false;
    if (side_p == 0 && side_q == 0) {
        const int axis = projection_axis(t.v0, t.v1, t.v2);
        if (axis < 3) return coplanar_touch(p, q, t, axis);
        return segments_touch(p, q, t.v0, t.v1) || segments_touch(p, q, t.v1, t.v2) ||
               segments_touch(p, q, t.v2, t.v0);
    }
    // The line crosses the plane in one point: where, seen along the line?
    const int ab = side_of_plane(p, q, t.v0, t.v1), bc = side_of_plane(p, q, t.v1, t.v2);
    if (ab * bc < 0) return false;
    const int ca = side_of_plane(p, q, t.v2, t.v0);
    return ab * ca >= 0 && bc * ca >= 0;
}

template <class Vec, class Corners>
RAYDIX_HD inline bool segment_touches_triangle(Vec p, Vec q, const Corners& t) {
    if (!boxes_touch(segment_box(p, q), box_of(t.v0, t.v1, t.v2))) return false;
    return segment_touches(p, q, t, side_of_plane(t.v0, t.v1, t.v2, p),
                           side_of_plane(t.v0, t.v1, t.v2, q));
}

template <class Vec, class Corners>
RAYDIX_HD inline bool point_on_triangle(Vec p, const Corners& t) {
    return segment_touches_triangle(p, p, t);
}

/// Sides of a triangle's corners with respect to a plane.
struct CornerSides {
    int a, b, c;
    [[nodiscard]] RAYDIX_HD bool all_off() const {
        return (a > 0 && b > 0 && c > 0) || (a < 0 && b < 0 && c < 0);
    }
};
template <class Corners>
RAYDIX_HD inline CornerSides sides_of(const Corners& plane, const Corners& t) {
    return {side_of_plane(plane.v0, plane.v1, plane.v2, t.v0),
            side_of_plane(plane.v0, plane.v1, plane.v2, t.v1),
            side_of_plane(plane.v0, plane.v1, plane.v2, t.v2)};
}

/// Where two triangles meet, an edge of one meets the other: what they share is a point, a segment
/// between two edges, or, in one plane, a polygon with a corner on an edge.
template <class Corners>
RAYDIX_HD inline bool triangles_touch(const Corners& s, const Corners& t) {
    const CornerSides of_s = sides_of(t, s);
    if (of_s.all_off()) return false;
    const CornerSides of_t = sides_of(s, t);
    if (of_t.all_off()) return false;
    return segment_touches(s.v0, s.v1, t, of_s.a, of_s.b) ||
           segment_touches(s.v1, s.v2, t, of_s.b, of_s.c) ||
           segment_touches(s.v2, s.v0, t, of_s.c, of_s.a) ||
           segment_touches(t.v0, t.v1, s, of_t.a, of_t.b) ||
           segment_touches(t.v1, t.v2, s, of_t.b, of_t.c) ||
           segment_touches(t.v2, t.v0, s, of_t.c, of_t.a);
}

/// Whether a corner of one is a corner of the other.
template <class Corners>
RAYDIX_HD inline bool share_a_corner(const Corners& s, const Corners& t) {
    const auto is_corner = [&](auto p) { return p == t.v0 || p == t.v1 || p == t.v2; };
    return is_corner(s.v0) || is_corner(s.v1) || is_corner(s.v2);
}

}  // namespace raydix
