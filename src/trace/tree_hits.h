// Closest and any hit of one ray in a binary tree of triangles.
#pragma once

#include <raydix/bvh.h>

#include <cstdint>
#include <type_traits>

#include "trace/triangle_test.h"
#include "trace/walk.h"

namespace raydix {

/// What a walk reads, without going through the Bvh each time. The tree must hold triangles.
struct TriangleTree {
    const BvhNode* nodes;
    const LeafTriangle* triangles;
    const std::uint32_t* order;
    std::uint32_t max_depth;
    bool empty;

    explicit TriangleTree(const Bvh& bvh)
        : nodes(bvh.nodes().data()),
          triangles(bvh.triangles().data()),
          order(bvh.order().data()),
          max_depth(bvh.max_depth()),
          empty(bvh.empty()) {}
};

template <class Steps>
void count_test(Steps& steps) {
    if constexpr (!std::is_same_v<Steps, NoSteps>) ++steps.triangle_tests;
}

/// The best hit so far: position in leaf order and t in the frame's units.
struct ClosestHit {
    float t;
    std::uint32_t prim = no_primitive;
    std::uint32_t position = no_primitive;
    float u = 0.0f, v = 0.0f;
};

template <class Steps>
ClosestHit find_closest(const TriangleTree& tree, const RayFrame& ray, WalkStack& stack,
                        Steps& steps) {
    ClosestHit best{ray.tmax};
    const auto leaf = [&](const BvhNode& node) {
        for (std::uint32_t k = node.first; k < node.first + node.count; ++k) {
            TriangleHit hit;
            count_test(steps);
            if (!intersect_triangle<EdgeRule::closed>(ray, tree.triangles[k], best.t, hit))
                continue;
            // At equal t the lower primitive id wins, whatever order the leaves come in.
            if (hit.t < best.t || tree.order[k] < best.prim)
                best = {hit.t, tree.order[k], k, hit.u, hit.v};
        }
        return false;
    };
    walk_tree(tree.nodes, ray, stack, steps, leaf, [&] { return best.t; });
    return best;
}

template <class Steps>
bool find_any(const TriangleTree& tree, const RayFrame& ray, WalkStack& stack, Steps& steps) {
    bool found = false;
    const auto leaf = [&](const BvhNode& node) {
        for (std::uint32_t k = node.first; k < node.first + node.count && !found; ++k) {
            TriangleHit hit;
            count_test(steps);
            found = intersect_triangle<EdgeRule::closed>(ray, tree.triangles[k], ray.tmax, hit);
        }
        return found;
    };
    walk_tree(tree.nodes, ray, stack, steps, leaf, [&] { return ray.tmax; });
    return found;
}

}  // namespace raydix
