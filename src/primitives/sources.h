// What a builder needs of a primitive: its box, and whether it counts at all. One small struct per
// kind of input. Boxes hold no -0, so that minima and maxima have one bit pattern.
#pragma once

#include <raydix/bvh.h>
#include <raydix/types.h>

#include <cstdint>

#include "base/hd.h"
#include "base/math.h"

namespace raydix {

struct TriangleSource {
    const Vec3* vertices;
    const Triangle* triangles;
    std::uint64_t vertex_count;

    /// False if an index points past the vertices: then nothing else may be asked.
    [[nodiscard]] RAYDIX_HD bool readable(std::uint32_t i) const {
        const Triangle& t = triangles[i];
        return t[0] < vertex_count && t[1] < vertex_count && t[2] < vertex_count;
    }
    [[nodiscard]] RAYDIX_HD Vec3 corner(std::uint32_t i, int k) const {
        return without_negative_zero(vertices[triangles[i][static_cast<std::size_t>(k)]]);
    }
    [[nodiscard]] LeafTriangle corners(std::uint32_t i) const {
        return {corner(i, 0), corner(i, 1), corner(i, 2)};
    }
    /// False if the triangle is to be left out; `box` is written either way.
    RAYDIX_HD bool box(std::uint32_t i, Aabb& box) const {
        const Vec3 a = corner(i, 0), b = corner(i, 1), c = corner(i, 2);
        box = box_of(a, b, c);
        return in_range(a) && in_range(b) && in_range(c) && diagonal_in_range(box);
    }
};

struct BoxSource {
    const Aabb* boxes;

    [[nodiscard]] RAYDIX_HD bool readable(std::uint32_t) const { return true; }
    RAYDIX_HD bool box(std::uint32_t i, Aabb& box) const {
        box = {without_negative_zero(boxes[i].lo), without_negative_zero(boxes[i].hi)};
        return in_range(box.lo) && in_range(box.hi) && !is_empty(box) && diagonal_in_range(box);
    }
};

struct PointSource {
    const Vec3* points;

    [[nodiscard]] RAYDIX_HD bool readable(std::uint32_t) const { return true; }
    RAYDIX_HD bool box(std::uint32_t i, Aabb& box) const {
        const Vec3 p = without_negative_zero(points[i]);
        box = {p, p};
        return in_range(p);
    }
};

}  // namespace raydix
