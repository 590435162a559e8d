// Depth-first walk of one ray through the binary tree, nearer child first. What happens at a leaf,
// and how far the ray still reaches, is the caller's.
#pragma once

#include <raydix/bvh.h>

#include <array>
#include <cstdint>
#include <memory>
#include <utility>

#include "base/check.h"
#include "trace/host_slabs.h"
#include "trace/slab.h"

namespace raydix {

template <class Scalar>
struct BasicPendingNode {
    std::uint32_t slot;
    Scalar entry;
};
using PendingNode = BasicPendingNode<float>;

/// Room for one pending sibling per level of the deepest path: taken from the tree's exact depth,
/// so that no walk can run over. Radix trees fit the array; deeper ones use the heap.
template <class Scalar>
class BasicWalkStack {
public:
    using Pending = BasicPendingNode<Scalar>;
    explicit BasicWalkStack(std::uint32_t max_depth) : capacity_(max_depth) {
        if (max_depth > inside_.size()) outside_ = std::make_unique<Pending[]>(max_depth);
    }
    [[nodiscard]] Pending* begin() { return outside_ ? outside_.get() : inside_.data(); }
    [[nodiscard]] std::uint32_t capacity() const { return capacity_; }

private:
    std::array<Pending, 96> inside_;
    std::unique_ptr<Pending[]> outside_;
    std::uint32_t capacity_;
};
using WalkStack = BasicWalkStack<float>;
using WalkStackD = BasicWalkStack<double>;

/// Counts nothing; RaySteps counts.
struct NoSteps {};

/// `leaf(node) -> bool` handles a leaf and says whether to stop; `reach()` is the largest t that
/// still matters: a node is skipped only if its padded entry is greater, or its padded exit less
/// than `tmin`. The tree must not be empty.
template <class Scalar, class Steps, class Leaf, class Reach>
[[gnu::always_inline]] inline void walk_slabs(const BvhNode* nodes,
                                              const BasicSlabFrame<Scalar>& slabs, Scalar tmin,
                                              BasicWalkStack<Scalar>& stack, Steps& steps,
                                              const Leaf& leaf, const Reach& reach) {
    constexpr bool counting = !std::is_same_v<Steps, NoSteps>;
    const auto whole = intersect_slabs(slabs, &nodes[0].lo.x, tmin, reach());
    if (!(whole.entry <= whole.exit)) return;
    const HostSlabsOf<Scalar> children(slabs, tmin);
    BasicPendingNode<Scalar>* const bottom = stack.begin();
    BasicPendingNode<Scalar>* top = bottom;
    std::uint32_t slot = 0;
    for (;;) {
        const BvhNode& node = nodes[slot];
        if constexpr (counting) ++steps.node_visits;
        if (node.is_leaf()) {
            if (leaf(node)) return;
        } else {
            const auto pair = children.intersect(&nodes[node.first], reach());
            if (pair.hit == 3) {
                const bool b_first = pair.entry_b < pair.entry_a;
                RAYDIX_CHECK(static_cast<std::uint32_t>(top - bottom), <, stack.capacity());
                *top++ = {node.first + (b_first ? 0u : 1u), b_first ? pair.entry_a : pair.entry_b};
                slot = node.first + (b_first ? 1u : 0u);
                continue;
            }
            if (pair.hit != 0) {
                slot = node.first + (pair.hit == 2 ? 1u : 0u);
                continue;
            }
        }
        do {
            if (top == bottom) return;
            slot = (--top)->slot;
        } while (top->entry > reach());
    }
}

template <class Scalar, class Steps, class Leaf, class Reach>
void walk_tree(const BvhNode* nodes, const BasicRayFrame<Scalar>& ray,
               BasicWalkStack<Scalar>& stack, Steps& steps, const Leaf& leaf, const Reach& reach) {
    walk_slabs(nodes, make_slab_frame(ray, {nodes[0].lo, nodes[0].hi}), ray.tmin, stack, steps,
               leaf, reach);
}

}  // namespace raydix
