// Box queries by integer cells. The grid's cell is a monotone function of each coordinate, so lo <=
// p <= hi implies cell(lo) <= cell(p) <= cell(hi), and cell(lo) < cell(p) implies lo < p: nodes are
// skipped and taken without rounding.
#pragma once

#include <raydix/octree.h>

#include <cmath>
#include <cstdint>

#include "tree/octree_walk.h"

namespace raydix {

/// Finest cells of a closed box: below the grid -1, above it 2^bits.
struct CellBox {
    std::array<std::int32_t, 3> lo, hi;
};

inline bool is_valid_query(const Aabb& box) {
    for (const float x : {box.lo.x, box.lo.y, box.lo.z, box.hi.x, box.hi.y, box.hi.z})
        if (!std::isfinite(x)) return false;
    return box.lo.x <= box.hi.x && box.lo.y <= box.hi.y && box.lo.z <= box.hi.z;
}

/// The cells of a point that may lie anywhere, each coordinate for itself.
inline std::array<std::int32_t, 3> cells_of(const Octree& octree, const Grid& grid, Vec3 p) {
    const Aabb scene = octree.bounds();
    const Cell inside = grid.cell(max_of(p, scene.lo));
    const std::int32_t past = std::int32_t{1} << axis_bits_of(octree);
    const auto one = [&](float x, float lo, float hi, std::uint32_t cell) {
        return x < lo ? -1 : x > hi ? past : static_cast<std::int32_t>(cell);
    };
    return {one(p.x, scene.lo.x, scene.hi.x, inside.x), one(p.y, scene.lo.y, scene.hi.y, inside.y),
            one(p.z, scene.lo.z, scene.hi.z, inside.z)};
}

enum class Overlap { none, some, all };

/// How the points of a node lie to the box, as far as cells tell.
inline Overlap overlap(const CellBox& box, const OctreeNode& node, int axis_bits) {
    const int shift = axis_bits - static_cast<int>(node.level);
    const Cell cell = cell_of_code(node.code);
    bool inside = true;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::uint32_t own = axis == 0 ? cell.x : axis == 1 ? cell.y : cell.z;
        const auto first = static_cast<std::int32_t>(own << shift);
        const auto last = static_cast<std::int32_t>(((own + 1) << shift) - 1);
        if (last < box.lo[axis] || first > box.hi[axis]) return Overlap::none;
        inside = inside && first > box.lo[axis] && last < box.hi[axis];
    }
    return inside ? Overlap::all : Overlap::some;
}

inline bool contains(const Aabb& box, Vec3 p) {
    return box.lo.x <= p.x && p.x <= box.hi.x && box.lo.y <= p.y && p.y <= box.hi.y &&
           box.lo.z <= p.z && p.z <= box.hi.z;
}

/// Calls found(position in leaf order) for every point in a valid box.
template <class Found>
void for_each_point_in_box(const Octree& octree, const Grid& grid, const Aabb& box,
                           const Found& found) {
    if (octree.empty()) return;
    const CellBox cells{cells_of(octree, grid, box.lo), cells_of(octree, grid, box.hi)};
    const int axis_bits = axis_bits_of(octree);
    walk_octree(octree, [&](std::uint32_t node_index) {
        const OctreeNode& node = octree.nodes()[node_index];
        const Overlap how = overlap(cells, node, axis_bits);
        if (how == Overlap::none) return false;
        if (how == Overlap::some && !node.is_leaf()) return true;
        for (std::uint32_t k = node.first_point; k < node.first_point + node.point_count; ++k)
            if (how == Overlap::all || contains(box, octree.points()[k])) found(k);
        return false;
    });
}

}  // namespace raydix
