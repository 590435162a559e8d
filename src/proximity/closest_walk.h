// Closest triangle of a tree to one query.
#pragma once

#include <raydix/bvh.h>
#include <raydix/double.h>

#include <cmath>

#include "proximity/walk_outward.h"
#include "trace/double_tree.h"
#include "trace/tree_hits.h"

namespace raydix {

/// The best so far; `position` in leaf order.
template <class Scalar>
struct BasicClosestTriangle {
    BasicTrianglePoint<Scalar> point;
    std::uint32_t prim = no_primitive;
    std::uint32_t position = no_primitive;
};
using ClosestTriangle = BasicClosestTriangle<float>;

/// A tree with the pad of its boxes.
struct PaddedTree : TriangleTree {
    float pad;

    explicit PaddedTree(const Bvh& bvh)
        : TriangleTree(bvh), pad(bvh.empty() ? 0.0f : box_pad(bvh)) {}

    [[nodiscard]] BoxDistances distances(Vec3 query) const { return {query, pad}; }
};

struct PaddedTreeD : TriangleTreeD {
    double reach = 0.0;  // of the nodes' coordinates
    double square;       // of the scale
    bool parts;          // leaves may hold parts of triangles
    double part_pad = 0.0;

    explicit PaddedTreeD(const BvhD& bvh)
        : TriangleTreeD(bvh),
          square(bvh.scale() * bvh.scale()),
          parts(bvh.tree().has_split_primitives()) {
        if (bvh.empty()) return;
        const BvhNode& root = bvh.tree().nodes()[0];
        const Vec3 far = max_of(max_of(root.hi, -1.0f * root.lo), Vec3{0.0f, 0.0f, 0.0f});
        reach = max_of(max_of(far.x, far.y), far.z);
        if (!parts) return;
        const AabbD box = bvh.bounds();
        const Vec3d most = max_of(max_of(box.hi, -1.0 * box.hi), max_of(box.lo, -1.0 * box.lo));
        part_pad = 0x1p-46 * bvh.scale() * max_of(max_of(most.x, most.y), most.z);
    }

    /// The query is rounded on its way to the nodes, and each distance once more: the pad is four
    /// times what both can add. A point found is in the triangle's own box, but up to a dozen
    /// roundings of the scene's coordinates beside its parts: `part_pad` is ten times that.
    [[nodiscard]] BoxDistancesD distances(Vec3d query) const {
        const Vec3d q = space.local(query);
        const double far = max_of(max_of(std::fabs(q.x), std::fabs(q.y)), std::fabs(q.z));
        return {q, 0x1p-50 * (far + reach) + part_pad};
    }
    [[nodiscard]] double local_square(double d2) const { return d2 * square; }
};

/// Takes the triangle at `position` if its (d2, prim) is less.
template <class Tree, class Scalar>
RAYDIX_HD inline void try_triangle(const Tree& tree, std::uint32_t position,
                                   BasicVec3<Scalar> query, BasicClosestTriangle<Scalar>& best) {
    const auto& t = tree.triangles[position];
    if (squared_distance_to_box(box_of(t.v0, t.v1, t.v2), query) > best.point.d2) return;
    const BasicTrianglePoint<Scalar> point = closest_on_triangle(t, query);
    const std::uint32_t prim = tree.order[position];
    if (point.d2 < best.point.d2 || (point.d2 == best.point.d2 && prim < best.prim))
        best = {point, prim, position};
}

/// The least (d2, prim) with d2 <= limit. `guess`: a position in leaf order that may be near, or
/// no_primitive; it saves time, and changes nothing else. The query must be finite, the tree not
/// empty. Tree: TriangleTree, PaddedTree or PaddedTreeD; distances and stack go with it.
template <class Tree, class Distances, class Stack>
RAYDIX_HD BasicClosestTriangle<typename Tree::Scalar> find_closest_triangle(
    const Tree& tree, const Distances& distances, BasicVec3<typename Tree::Scalar> query,
    typename Tree::Scalar limit, std::uint32_t guess, Stack& stack) {
    BasicClosestTriangle<typename Tree::Scalar> best{{{}, 0, 0, limit}};
    if (guess != no_primitive) try_triangle(tree, guess, query, best);
    const auto leaf = [&](const BvhNode& node) {
        for (std::uint32_t k = node.first; k < node.first + node.count; ++k)
            try_triangle(tree, k, query, best);
        return false;
    };
    walk_outward(tree.nodes, distances, stack, leaf,
                 [&] { return tree.local_square(best.point.d2); });
    return best;
}

template <class Tree, class Stack>
BasicClosestTriangle<typename Tree::Scalar> find_closest_triangle(
    const Tree& tree, BasicVec3<typename Tree::Scalar> query, typename Tree::Scalar limit,
    std::uint32_t guess, Stack& stack) {
    return find_closest_triangle(tree, tree.distances(query), query, limit, guess, stack);
}

}  // namespace raydix
