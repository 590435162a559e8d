// How far rays may be told that they hit beside the box of what they hit, through any number of
// instances: what boxes in the trees above must widen by. The sums are those of
// docs/algorithms/scenes.md.
#pragma once

#include <raydix/types.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/math.h"
#include "instances/affine.h"

namespace raydix {

/// Let a line in double enter something from this space and hit at t. The line's point at t is then
/// within error * D of `box`, D being the greatest distance, by components, from the line's origin
/// to a point of the box. Empty: lo > hi.
struct Extent {
    Aabb box = empty_box();
    double error = 0;

    [[nodiscard]] bool empty() const { return !(box.lo.x <= box.hi.x); }
};

inline double largest_coordinate(const Aabb& box) {
    double most = 0;
    for (const Vec3 p : {box.lo, box.hi})
        most = std::max(
            {most, std::fabs(double{p.x}), std::fabs(double{p.y}), std::fabs(double{p.z})});
    return most;
}

/// The box that reaches `by` farther at least, as floats. `most`: its largest coordinate.
inline Aabb grown(Double3 lo, Double3 hi, double most, double by) {
    by += 0x1p-23 * (most + by);  // what floats round
    const Double3 side{by, by, by};
    return {(lo - side).rounded(), (hi + side).rounded()};
}

/// Rays at triangles: the line is rounded to float, and its point at t is within the pads of
/// slab.h of the triangle.
inline Extent extent_of_mesh(const Aabb& box) {
    if (!(box.lo.x <= box.hi.x)) return {};
    const double most = largest_coordinate(box);
    return {grown(Double3(box.lo), Double3(box.hi), most, 0x1p-22 * most + double{min_diagonal}),
            0x1p-18};
}

inline Extent unite(const Extent& a, const Extent& b) {
    if (a.empty()) return b;
    if (b.empty()) return a;
    return {unite(a.box, b.box), std::max(a.error, b.error)};
}

/// Largest sum of a row's magnitudes.
inline double norm_of(const Affine& a) {
    const auto sum = [](Double3 row) {
        return std::fabs(row.x) + std::fabs(row.y) + std::fabs(row.z);
    };
    return std::max({sum(a.x), sum(a.y), sum(a.z)});
}

/// How errors grow on the way through a map and its computed inverse.
struct MapErrors {
    double condition = 1;  // |L| |L^-1|
    double rounding = 0;   // of the inverse, and of lines through it
};
/// The determinant is a sum of three products that may cancel: the inverse may be off in scale.
inline MapErrors errors_of(const Affine& a, const Affine& inverse) {
    const double size = length(a.x) * length(a.y) * length(a.z);
    const double determinant = std::fabs(dot(a.x, cross(a.y, a.z)));
    const double condition = norm_of(a) * norm_of(inverse);
    return {condition, 0x1p-48 * condition + 0x1p-49 * size / determinant};
}

/// Of what a map makes of `inner`.
inline Extent image_of(const Affine& a, const MapErrors& errors, const Extent& inner) {
    if (inner.empty()) return {};
    const Double3 lo(inner.box.lo), hi(inner.box.hi);
    const Double3 middle = (lo + hi) * 0.5, half = (hi - lo) * 0.5;
    const auto reach = [&](Double3 row) {
        return std::fabs(row.x) * half.x + std::fabs(row.y) * half.y + std::fabs(row.z) * half.z;
    };
    const Double3 center = a.point(middle), by{reach(a.x), reach(a.y), reach(a.z)};
    const double most = std::max(
        {std::fabs(center.x) + by.x, std::fabs(center.y) + by.y, std::fabs(center.z) + by.z});
    const double moved = std::max({std::fabs(a.move.x), std::fabs(a.move.y), std::fabs(a.move.z)});
    return {grown(center - by, center + by, most,
                  (errors.rounding + 0x1p-40) * (most + moved) + double{min_diagonal}),
            errors.condition * inner.error + errors.rounding};
}

}  // namespace raydix
