// A moving point against balls, capsules and rounded triangles, in double: the first t at which it
// is in one. All of them are convex, so a path enters once.
#pragma once

#include <raydix/bvh.h>
#include <raydix/types.h>

#include <algorithm>
#include <cmath>

#include "base/double3.h"
#include "proximity/closest_on_triangle.h"
#include "trace/grown_boxes.h"

namespace raydix {

/// Enters the set at t, or never; a path that starts in it enters at tmin. `enter` and `leave`
/// bound the line's stay.
inline double first_stay(const Path& path, double enter, double leave) {
    const double t = std::max(enter, path.tmin);
    return t <= leave && t <= path.tmax ? t : never;
}

/// Roots of the line against a ball around `center`; enter > leave if it misses.
struct Stay {
    double enter = never, leave = -never;
};

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

inline double enter_ball(const Path& path, Double3 center, double radius) {
    const Stay stay = stay_in_ball(path, center, radius);
    return first_stay(path, stay.enter, stay.leave);
}

/// The part of the line in the cylinder around a, b, between the planes through its ends.
inline Stay stay_in_cylinder(const Path& path, Double3 a, Double3 b, double radius) {
    const Double3 axis = b - a;
    const double length2 = dot(axis, axis);
    if (length2 == 0.0) return {};
    // What of the direction and of the origin is across the axis.
    const double along = dot(path.direction, axis);
    const Double3 across = path.direction - axis * (along / length2);
    const double across2 = dot(across, across);
    Stay stay{-never, never};
    const auto off_axis = [&](double t) {
        const Double3 p = path.at(t) - a;
        return p - axis * (dot(p, axis) / length2);
    };
    // Parallel up to rounding: in or out for good.
    if (across2 > 1e-28 * dot(path.direction, path.direction)) {
        const double middle = dot(a - path.origin, across) / across2;
        const Double3 off = off_axis(middle);
        const double room = radius * radius - dot(off, off);
        if (room < 0.0) return {};
        const double half = std::sqrt(room / across2);
        stay = {middle - half, middle + half};
    } else {
        const Double3 off = off_axis(0.0);
        if (dot(off, off) > radius * radius) return {};
    }
    const double start = dot(a - path.origin, axis), end = dot(b - path.origin, axis);
    if (along == 0.0) return start <= 0.0 && end >= 0.0 ? stay : Stay{};
    const double t0 = start / along, t1 = end / along;
    return {std::max(stay.enter, std::min(t0, t1)), std::min(stay.leave, std::max(t0, t1))};
}

/// As stay_in_cylinder, for paths that start at 0, in any direction: nearly along the axis too. All
/// lengths are taken from where the path comes closest to the segment's middle, and what is across
/// the axis from products with it, so that what rounding does is a shift of the cylinder by a few
/// roundings of the distance and its length.
inline Stay stay_in_far_cylinder(const Path& path, Double3 a, Double3 b, double radius) {
    const Double3 axis = b - a;
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

inline double enter_cylinder(const Path& path, Double3 a, Double3 b, double radius) {
    const Stay stay = stay_in_cylinder(path, a, b, radius);
    return stay.enter <= stay.leave ? first_stay(path, stay.enter, stay.leave) : never;
}

/// All points within `radius` of the segment.
inline double enter_capsule(const Path& path, Double3 a, Double3 b, double radius) {
    return std::min({enter_ball(path, a, radius), enter_ball(path, b, radius),
                     enter_cylinder(path, a, b, radius)});
}

/// The prism of height `radius` on both sides of the triangle; `normal` is that of its plane.
inline double enter_prism(const Path& path, Double3 a, Double3 b, Double3 c, Double3 normal,
                          double radius) {
    const double size = length(normal);
    if (size == 0.0) return never;
    Stay stay{-never, never};
    // Keeps the part of the line where n . (x - p) <= limit.
    const auto cut = [&](Double3 n, Double3 p, double limit) {
        const double rate = dot(n, path.direction), room = limit - dot(n, path.origin - p);
        if (rate > 0.0)
            stay.leave = std::min(stay.leave, room / rate);
        else if (rate < 0.0)
            stay.enter = std::max(stay.enter, room / rate);
        else if (room < 0.0)
            stay = {};
    };
    cut(normal, a, radius * size);
    cut(normal * -1.0, a, radius * size);
    cut(cross(b - a, normal), a, 0.0);
    cut(cross(c - b, normal), b, 0.0);
    cut(cross(a - c, normal), c, 0.0);
    return stay.enter <= stay.leave ? first_stay(path, stay.enter, stay.leave) : never;
}

/// All points within `radius` of the triangle.
inline double enter_rounded_triangle(const Path& path, Double3 a, Double3 b, Double3 c,
                                     Double3 normal, double radius) {
    return std::min({enter_prism(path, a, b, c, normal, radius), enter_ball(path, a, radius),
                     enter_ball(path, b, radius), enter_ball(path, c, radius),
                     enter_cylinder(path, a, b, radius), enter_cylinder(path, b, c, radius),
                     enter_cylinder(path, c, a, radius)});
}

inline double enter_rounded_triangle(const Path& path, const LeafTriangle& t, double radius) {
    const Double3 a(t.v0), b(t.v1), c(t.v2);
    return enter_rounded_triangle(path, a, b, c, cross(b - a, c - a), radius);
}

/// In double the path must start at 0 and `start` is where that is in the scene: corners are taken
/// from there, so that a place far from the origin costs no digits. The normal is that of the
/// corners as they are, since a sliver's would not survive a rounding of its edges.
inline double enter_rounded_triangle(const Path& path, Vec3d start, const LeafTriangleD& t,
                                     double radius) {
    const Double3 a(t.v0), b(t.v1), c(t.v2), from(start);
    return enter_rounded_triangle(path, a - from, b - from, c - from, accurate_cross(b - a, c - a),
                                  radius);
}

}  // namespace raydix
