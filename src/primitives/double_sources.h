// Triangles and boxes in double: what counts as one, its box, and whether it has an area.
#pragma once

#include <raydix/double.h>

#include <cmath>
#include <cstdint>

#include "base/exact_sign_double.h"
#include "base/math.h"
#include "primitives/exact_overlap.h"

namespace raydix {

/// contract.md 1, for doubles.
inline bool in_range(Vec3d p) {
    const auto ok = [](double x) { return x >= -1e12 && x <= 1e12; };
    return ok(p.x) && ok(p.y) && ok(p.z);
}
inline bool diagonal_in_range(const AabbD& box) {
    const Vec3d d = box.hi - box.lo;
    const double longest = max_of(max_of(d.x, d.y), d.z);
    if (longest >= 1e-12 || longest == 0.0) return true;
    return std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z) >= 1e-12;
}

/// Triangles without area are never hit by rays. Exact, as the signs of the edges are.
inline bool has_zero_area(const LeafTriangleD& t) { return projection_axis(t.v0, t.v1, t.v2) == 3; }

struct TriangleSourceD {
    const Vec3d* vertices;
    const Triangle* triangles;
    std::uint64_t vertex_count;

    [[nodiscard]] bool readable(std::uint32_t i) const {
        const Triangle& t = triangles[i];
        return t[0] < vertex_count && t[1] < vertex_count && t[2] < vertex_count;
    }
    [[nodiscard]] Vec3d corner(std::uint32_t i, int k) const {
        return without_tiny(vertices[triangles[i][static_cast<std::size_t>(k)]]);
    }
    [[nodiscard]] LeafTriangleD corners(std::uint32_t i) const {
        return {corner(i, 0), corner(i, 1), corner(i, 2)};
    }
    /// False if the triangle is to be left out; `box` is written either way.
    bool box(std::uint32_t i, AabbD& box) const {
        const LeafTriangleD t = corners(i);
        box = box_of(t.v0, t.v1, t.v2);
        return in_range(t.v0) && in_range(t.v1) && in_range(t.v2) && diagonal_in_range(box);
    }
};

struct BoxSourceD {
    const AabbD* boxes;

    bool box(std::uint32_t i, AabbD& box) const {
        box = {without_negative_zero(boxes[i].lo), without_negative_zero(boxes[i].hi)};
        return in_range(box.lo) && in_range(box.hi) && box.lo.x <= box.hi.x &&
               box.lo.y <= box.hi.y && box.lo.z <= box.hi.z && diagonal_in_range(box);
    }
};

}  // namespace raydix
