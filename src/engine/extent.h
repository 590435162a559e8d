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

/// The box that reaches `by` farther, rounded outward.
inline Aabb grown(Double3 lo, Double3 hi, double by) {
    const auto down = [&](double x) {
        const double exact = x - by;
        const auto rounded = static_cast<float>(exact);
        return double{rounded} <= exact ? rounded : std::nextafterf(rounded, -infinity);
    };
    return {{down(lo.x), down(lo.y), down(lo.z)}, {-down(-hi.x), -down(-hi.y), -down(-hi.z)}};
}

/// Rays at triangles: the line is rounded to float, and its point at t is within the pads of
/// slab.h of the triangle.
inline Extent extent_of_mesh(const Aabb& box) {
    if (!(box.lo.x <= box.hi.x)) return {};
    return {grown(Double3(box.lo), Double3(box.hi),
                  0x1p-22 * largest_coordinate(box) + double{min_diagonal}),
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

/// How far the computed inverse may be off in scale: its determinant is a sum of three products
/// that may cancel.
inline double determinant_error(const Affine& a) {
    const double size = length(a.x) * length(a.y) * length(a.z);
    return 0x1p-49 * size / std::fabs(dot(a.x, cross(a.y, a.z)));
}

/// Of what a map makes of `inner`; `inverse` is the way in.
inline Extent image_of(const Affine& a, const Affine& inverse, const Extent& inner) {
    if (inner.empty()) return {};
    const double condition = norm_of(a) * norm_of(inverse);
    const double rounding = 0x1p-48 * condition + determinant_error(a);
    const Double3 lo(inner.box.lo), hi(inner.box.hi);
    const Double3 middle = (lo + hi) * 0.5, half = (hi - lo) * 0.5;
    const auto reach = [&](Double3 row) {
        return std::fabs(row.x) * half.x + std::fabs(row.y) * half.y + std::fabs(row.z) * half.z;
    };
    const Double3 center = a.point(middle), by{reach(a.x), reach(a.y), reach(a.z)};
    const Double3 outer_lo = center - by, outer_hi = center + by;
    const double most =
        std::max({std::fabs(outer_lo.x), std::fabs(outer_lo.y), std::fabs(outer_lo.z),
                  std::fabs(outer_hi.x), std::fabs(outer_hi.y), std::fabs(outer_hi.z)}) +
        std::max({std::fabs(a.move.x), std::fabs(a.move.y), std::fabs(a.move.z)});
    return {grown(outer_lo, outer_hi, (rounding + 0x1p-40) * most + double{min_diagonal}),
            condition * inner.error + rounding};
}

}  // namespace raydix
