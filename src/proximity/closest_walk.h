// Closest triangle of a tree to one query.
#pragma once

#include <raydix/bvh.h>

#include <cmath>

#include "proximity/walk_outward.h"
#include "trace/tree_hits.h"

namespace raydix {

/// The best so far; `position` in leaf order.
struct ClosestTriangle {
    TrianglePoint point;
    std::uint32_t prim = no_primitive;
    std::uint32_t position = no_primitive;
};

/// A tree with the pad of its boxes.
struct PaddedTree : TriangleTree {
    float pad;

    explicit PaddedTree(const Bvh& bvh)
        : TriangleTree(bvh), pad(bvh.empty() ? 0.0f : box_pad(bvh)) {}
};

inline bool is_finite(Vec3 p) {
    return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
}

/// Takes the triangle at `position` if its (d2, prim) is less.
inline void try_triangle(const TriangleTree& tree, std::uint32_t position, Vec3 query,
                         ClosestTriangle& best) {
    const LeafTriangle& t = tree.triangles[position];
    if (squared_distance_to_box(box_of(t.v0, t.v1, t.v2), query) > best.point.d2) return;
    const TrianglePoint point = closest_on_triangle(t, query);
    const std::uint32_t prim = tree.order[position];
    if (point.d2 < best.point.d2 || (point.d2 == best.point.d2 && prim < best.prim))
        best = {point, prim, position};
}

/// The least (d2, prim) with d2 <= limit. `guess`: a position in leaf order that may be near, or
/// no_primitive; it saves time, and changes nothing else. The query must be finite, the tree not
/// empty.
inline ClosestTriangle find_closest_triangle(const PaddedTree& tree, Vec3 query, float limit,
                                             std::uint32_t guess, WalkStack& stack) {
    ClosestTriangle best{{{}, 0.0f, 0.0f, limit}};
    if (guess != no_primitive) try_triangle(tree, guess, query, best);
    const auto leaf = [&](const BvhNode& node) {
        for (std::uint32_t k = node.first; k < node.first + node.count; ++k)
            try_triangle(tree, k, query, best);
        return false;
    };
    walk_outward(tree.nodes, BoxDistances(query, tree.pad), stack, leaf,
                 [&] { return best.point.d2; });
    return best;
}

}  // namespace raydix
