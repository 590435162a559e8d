// A moving point against balls, capsules and rounded triangles, in double: its line's stay in them.
// All of them are convex, so a line enters once.
#pragma once

#include <raydix/bvh.h>
#include <raydix/types.h>

#include <algorithm>
#include <cmath>

#include "base/double3.h"
#include "proximity/contact_steps.h"
#include "trace/grown_boxes.h"

namespace raydix {

/// A part of a line; enter > leave if it is empty.
struct Stay {
    double enter = never, leave = -never;

    [[nodiscard]] bool empty() const { return !(enter <= leave); }
};

/// Of two parts of one convex set.
inline Stay unite(const Stay& a, const Stay& b) {
    if (a.empty()) return b;
    if (b.empty()) return a;
    return {std::min(a.enter, b.enter), std::max(a.leave, b.leave)};
}

/// Measured from where the line comes closest, so that a far origin costs no precision.
inline Stay stay_in_ball(const Path& path, Double3 center, double radius) {
    const double d2 = dot(path.direction, path.direction);
    const double middle = dot(center - path.origin, path.direction) / d2;
    const Double3 off = path.at(middle) - center;
    const double room = radius * radius - dot(off, off);
    if (room < 0.0) return {};
    const double half = std::sqrt(room / d2);
    return {middle - half, middle + half};
}

/// The part of the line in the cylinder around a, b, between the planes through its ends. Lines
/// nearly along the axis too: all lengths are taken from where the line comes closest to the
/// segment's middle, and what is across the axis from products with it, so that what rounding does
/// is a shift of the cylinder by a few roundings of the distance and its length.
inline Stay stay_in_cylinder(const Path& path, Double3 a, Double3 axis, double radius) {
    const double length2 = dot(axis, axis);
    if (length2 == 0.0) return {};
    const double middle =
        dot(a + axis * 0.5 - path.origin, path.direction) / dot(path.direction, path.direction);
    const Double3 from_a = path.at(middle) - a;
    // Turned by a quarter and longer by the axis: the offset from it, and its change with t.
    const Double3 off = cross(from_a, axis), drift = cross(path.direction, axis);
    const double drift2 = dot(drift, drift), limit2 = radius * radius * length2;
    Stay stay{-never, never};
    if (drift2 > 0.0) {
        const double closest = -dot(off, drift) / drift2;
        const Double3 least = off + drift * closest;
        const double room = limit2 - dot(least, least);
        if (!(room >= 0.0)) return {};
        const double half = std::sqrt(room / drift2);
        stay = {closest - half, closest + half};
    } else if (!(dot(off, off) <= limit2)) {  // parallel: in or out for good
        return {};
    }
    const double along = dot(path.direction, axis), start = -dot(from_a, axis),
                 end = start + length2;
    if (along == 0.0) {
        if (!(start <= 0.0 && end >= 0.0)) return {};
    } else {
        const double t0 = start / along, t1 = end / along;
        stay = {std::max(stay.enter, std::min(t0, t1)), std::min(stay.leave, std::max(t0, t1))};
    }
    if (!(stay.enter <= stay.leave)) return {};
    return {middle + stay.enter, middle + stay.leave};
}

/// All points within `radius` of the segment.
inline Stay stay_in_capsule(const Path& path, Double3 a, Double3 axis, double radius) {
    const Stay ends = unite(stay_in_ball(path, a, radius), stay_in_ball(path, a + axis, radius));
    return unite(ends, stay_in_cylinder(path, a, axis, radius));
}

/// All points within `radius` of a triangle that is no needle: the prism on both sides of it,
/// cylinders around edges, balls around corners.
inline Stay stay_in_rounded_triangle(const Path& path, const PathTriangle& t, Double3 normal,
                                     double radius) {
    Stay prism{-never, never};
    // Keeps the part of the line where n . (x - p) <= limit.
    const auto cut = [&](Double3 n, Double3 p, double limit) {
        const double rate = dot(n, path.direction), room = limit - dot(n, path.origin - p);
        if (rate > 0.0)
            prism.leave = std::min(prism.leave, room / rate);
        else if (rate < 0.0)
            prism.enter = std::max(prism.enter, room / rate);
        else if (room < 0.0)
            prism = {};
    };
    const double height = radius * length(normal);
    cut(normal, t.a, height);
    cut(normal * -1.0, t.a, height);
    const double at_plane = prism.enter;
    cut(cross(t.ab, normal), t.a, 0.0);
    cut(cross(t.bc, normal), t.b, 0.0);
    cut(cross(normal, t.ac), t.a, 0.0);
    // Before it reaches one of the first two planes, a ball touches no edge either.
    const bool first = prism.enter == at_plane || prism.enter <= path.tmin;
    if (first && !prism.empty() && prism.leave >= path.tmin) return prism;
    Stay stay = prism;
    for (const Double3& corner : {t.a, t.b, t.c})
        stay = unite(stay, stay_in_ball(path, corner, radius));
    stay = unite(stay, stay_in_cylinder(path, t.a, t.ab, radius));
    stay = unite(stay, stay_in_cylinder(path, t.b, t.bc, radius));
    return unite(stay, stay_in_cylinder(path, t.a, t.ac, radius));
}

/// Height over longest edge, squared, below which a triangle is a needle: what rounding takes from
/// a place is divided by this on the way to t, and a float's t has fewer digits to lose.
template <class Corners>
inline constexpr double needle = 0x1p-8;
template <>
inline constexpr double needle<LeafTriangle> = 0x1p-32;

/// When the path comes within `radius` of the triangle, not before `own`, when it enters the
/// triangle's own box, or never. `start`: where the path's 0 is in the scene.
template <class Corners>
double enter_rounded_triangle(const Path& path, Double3 start, const Corners& corners,
                              double radius, double own) {
    const PathTriangle t(corners, start);
    const Double3 normal = cross(t.ab, t.ac);
    const double longest2 = std::max({dot(t.ab, t.ab), dot(t.ac, t.ac), dot(t.bc, t.bc)});
    if (!(dot(normal, normal) > needle<Corners> * longest2 * longest2))
        return ContactSteps(path, t, radius).run(own);
    const Stay stay = stay_in_rounded_triangle(path, t, normal, radius);
    const double at = std::max(stay.enter, path.tmin);
    if (!(at <= stay.leave && at <= path.tmax)) return never;
    if (own <= at) return at;
    // The box of a slow axis may be entered late, even after a path that grazes has left.
    if (own <= stay.leave && own <= path.tmax) return own;
    return ContactSteps(path, t, radius).run(own);
}

}  // namespace raydix
