// Closest, any and all hits of one ray in a binary tree of triangles, of floats or of doubles.
#pragma once

#include <raydix/bvh.h>

#include <cstdint>
#include <type_traits>

#include "trace/triangle_test.h"
#include "trace/walk.h"

namespace raydix {

/// What a walk reads, without going through the Bvh each time. The tree must hold triangles.
struct TriangleTree {
    using Scalar = float;
    using Corners = LeafTriangle;

    const BvhNode* nodes = nullptr;
    const LeafTriangle* triangles = nullptr;
    const std::uint32_t* order = nullptr;
    std::uint32_t max_depth = 0;
    bool empty = true;

    TriangleTree() = default;
    explicit TriangleTree(const Bvh& bvh)
        : nodes(bvh.nodes().data()),
          triangles(bvh.triangles().data()),
          order(bvh.order().data()),
          max_depth(bvh.max_depth()),
          empty(bvh.empty()) {}

    /// The ray where the nodes are: they are where the triangles are.
    [[nodiscard]] const RayFrame& local(const RayFrame& ray) const { return ray; }
    /// A squared distance of the caller, where the nodes are.
    [[nodiscard]] RAYDIX_HD float local_square(float d2) const { return d2; }
};

template <class Steps>
void count_test(Steps& steps) {
    if constexpr (!std::is_same_v<Steps, NoSteps>) ++steps.triangle_tests;
}

/// The best hit so far: position in leaf order and t in the frame's units.
template <class Scalar>
struct BasicClosestHit {
    Scalar t;
    std::uint32_t prim = no_primitive;
    std::uint32_t position = no_primitive;
    Scalar u = 0, v = 0;
};
using ClosestHit = BasicClosestHit<float>;

/// Tree: TriangleTree or TriangleTreeD.
template <class Tree, class Scalar, class Steps>
BasicClosestHit<Scalar> find_closest(const Tree& tree, const BasicRayFrame<Scalar>& ray,
                                     BasicWalkStack<Scalar>& stack, Steps& steps) {
    BasicClosestHit<Scalar> best{ray.tmax};
    const auto leaf = [&](const BvhNode& node) {
        for (std::uint32_t k = node.first; k < node.first + node.count; ++k) {
            BasicTriangleHit<Scalar> hit;
            count_test(steps);
            if (!intersect_triangle<EdgeRule::closed>(ray, tree.triangles[k], best.t, hit))
                continue;
            // At equal t the lower primitive id wins, whatever order the leaves come in.
            if (hit.t < best.t || tree.order[k] < best.prim)
                best = {hit.t, tree.order[k], k, hit.u, hit.v};
        }
        return false;
    };
    walk_tree(tree.nodes, tree.local(ray), stack, steps, leaf, [&] { return best.t; });
    return best;
}

template <class Tree, class Scalar, class Steps>
bool find_any(const Tree& tree, const BasicRayFrame<Scalar>& ray, BasicWalkStack<Scalar>& stack,
              Steps& steps) {
    bool found = false;
    const auto leaf = [&](const BvhNode& node) {
        for (std::uint32_t k = node.first; k < node.first + node.count && !found; ++k) {
            BasicTriangleHit<Scalar> hit;
            count_test(steps);
            found = intersect_triangle<EdgeRule::closed>(ray, tree.triangles[k], ray.tmax, hit);
        }
        return found;
    };
    walk_tree(tree.nodes, tree.local(ray), stack, steps, leaf, [&] { return ray.tmax; });
    return found;
}

/// Calls take(t, position, u, v) for each triangle hit, once per leaf that it is in; t in the
/// caller's units.
template <class Tree, class Scalar, class Steps, class Take>
void find_all(const Tree& tree, const BasicRayFrame<Scalar>& ray, BasicWalkStack<Scalar>& stack,
              Steps& steps, const Take& take) {
    const auto leaf = [&](const BvhNode& node) {
        for (std::uint32_t k = node.first; k < node.first + node.count; ++k) {
            BasicTriangleHit<Scalar> hit;
            count_test(steps);
            if (intersect_triangle<EdgeRule::half_open>(ray, tree.triangles[k], ray.tmax, hit))
                take(hit.t * ray.t_scale, k, hit.u, hit.v);
        }
        return false;
    };
    walk_tree(tree.nodes, tree.local(ray), stack, steps, leaf, [&] { return ray.tmax; });
}

}  // namespace raydix
