// How far rays may be told that they hit beside the box of what they hit, through any number of
// instances: what boxes in the trees above must widen by. The sums are those of
// docs/algorithms/scenes.md.
#pragma once

#include <raydix/types.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "base/math.h"
#include "engine/affine.h"
#include "engine/support.h"

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
/// slab.h of the triangle. What of that does not grow with D:
inline double mesh_pad(const Aabb& box) {
    return 0x1p-22 * largest_coordinate(box) + double{min_diagonal};
}
inline Extent extent_of_mesh(const Aabb& box) {
    if (!(box.lo.x <= box.hi.x)) return {};
    return {grown(Double3(box.lo), Double3(box.hi), largest_coordinate(box), mesh_pad(box)),
            0x1p-18};
}

inline Extent unite(const Extent& a, const Extent& b) {
    if (a.empty()) return b;
    if (b.empty()) return a;
    return {unite(a.box, b.box), std::max(a.error, b.error)};
}

/// Whether what `all` is around may be less once `one` of them has become `now`.
inline bool may_shrink(const Extent& all, const Extent& one, const Extent& now) {
    const auto at = [](Vec3 a, Vec3 b) { return a.x == b.x || a.y == b.y || a.z == b.z; };
    return at(all.box.lo, one.box.lo) || at(all.box.hi, one.box.hi) ||
           (one.error == all.error && now.error < one.error);
}

/// Largest sum of a row's magnitudes.
inline double norm_of(const Affine& a) {
    const auto sum = [](Double3 row) {
        return std::fabs(row.x) + std::fabs(row.y) + std::fabs(row.z);
    };
    return std::max({sum(a.x), sum(a.y), sum(a.z)});
}

/// At least the most that a map lengthens a vector, and that but for roundings where it turns and
/// stretches along axes. L^T L and L L^T have its square as their largest eigenvalue.
inline double length_norm_of(const Affine& a) {
    const auto largest_sum = [](Double3 x, Double3 y, Double3 z) {
        const double xy = std::fabs(dot(x, y)), yz = std::fabs(dot(y, z)),
                     zx = std::fabs(dot(z, x));
        return std::max({dot(x, x) + xy + zx, dot(y, y) + yz + xy, dot(z, z) + zx + yz});
    };
    const double by_rows = largest_sum(a.x, a.y, a.z),
                 by_columns = largest_sum({a.x.x, a.y.x, a.z.x}, {a.x.y, a.y.y, a.z.y},
                                          {a.x.z, a.y.z, a.z.z});
    return std::sqrt(std::min(by_rows, by_columns));
}

/// How errors grow on the way through a map and its computed inverse.
struct MapErrors {
    double condition = 1;  // |L| |L^-1|
    double rounding = 0;   // of the inverse, and of lines through it
    // The same by lengths of vectors, which turns do not change.
    double length_condition = 1, length_rounding = 0;
};
/// The determinant is a sum of three products that may cancel: the inverse may be off in scale.
inline MapErrors errors_of(const Affine& a, const Affine& inverse) {
    const double size = length(a.x) * length(a.y) * length(a.z);
    const double scale = 0x1p-49 * size / std::fabs(dot(a.x, cross(a.y, a.z)));
    const double condition = norm_of(a) * norm_of(inverse),
                 length_condition = length_norm_of(a) * length_norm_of(inverse);
    return {condition, 0x1p-48 * condition + scale, length_condition,
            0x1p-47 * length_condition + 2 * scale};
}

/// A scene that stands in another one, however many instances lead to it.
struct Image {
    Affine map;        // from its space to that of the other scene
    double size = 0;   // at least the largest coordinate of the image
    double slack = 0;  // how far rays may miss the image, by components, but for what grows with D
    double error = 0;  // as in Extent
    double rounding = 0;  // what of the error comes from lines on the way, by lengths
};

/// Of a scene without instances in its own space.
inline Image image_of(const Extent& scene) {
    return {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {}}, largest_coordinate(scene.box), 0, scene.error};
}

/// The error of the image of a scene whose own is `innermost`, by the condition of all maps
/// together; infinity where it is not known well or large anyway.
inline double error_of_product(const Image& image, double innermost) {
    constexpr double unknown = std::numeric_limits<double>::infinity();
    const double norm = norm_of(image.map);
    if (!(image.rounding < 0x1p-10 && norm > 0x1p-300 && norm < 0x1p300)) return unknown;
    const std::optional<Affine> inverse = inverse_of(image.map);
    if (!inverse) return unknown;
    const double error = 1.0625 * norm * norm_of(*inverse) * innermost + 2 * image.rounding;
    return error < 0x1p-6 ? error : unknown;
}

/// One instance farther out. `innermost`: the error of the scene in its own space.
inline Image image_of(const Affine& a, const MapErrors& errors, const Image& inner,
                      double innermost) {
    const Affine& m = inner.map;
    const auto row = [&](Double3 r) { return m.x * r.x + m.y * r.y + m.z * r.z; };
    const double norm = norm_of(a);
    const double moved = std::max({std::fabs(a.move.x), std::fabs(a.move.y), std::fabs(a.move.z)});
    const double size = norm * inner.size + moved;
    Image out{{row(a.x), row(a.y), row(a.z), a.point(m.move)},
              size,
              norm * inner.slack + (errors.rounding + 0x1p-40) * 2.0 * size + double{min_diagonal},
              errors.condition * inner.error + errors.rounding,
              errors.length_condition * inner.rounding + errors.length_rounding};
    const bool is_first = inner.rounding == 0;
    if (!is_first) out.error = std::min(out.error, error_of_product(out, innermost));
    return out;
}

/// `support` is that of the scene.
inline Extent extent_of(const Image& image, const Support& support) {
    const Affine& m = image.map;
    const Reach x = support.along(m.x), y = support.along(m.y), z = support.along(m.z);
    const Double3 lo = m.move - Double3{x.against, y.against, z.against},
                  hi = m.move + Double3{x.along, y.along, z.along};
    return {grown(lo, hi, image.size, image.slack), image.error};
}

}  // namespace raydix
