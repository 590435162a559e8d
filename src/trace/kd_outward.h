// Walk of one point through a k-d tree, outward from where it lies. For host and device: the stack
// is the caller's, KdStack on the host and KdLocalStack in a thread of a device.
#pragma once

#include <raydix/kdtree.h>

#include <cstdint>

#include "base/check.h"
#include "base/hd.h"
#include "base/math.h"

namespace raydix {

/// What walks read, without going through the KdTree each time.
struct KdTreeView {
    const KdNode* nodes = nullptr;
    const std::uint32_t* order = nullptr;
    Aabb bounds{};
    std::uint32_t max_depth = 0;
    bool empty = true;

    KdTreeView() = default;
    explicit KdTreeView(const KdTree& tree)
        : nodes(tree.nodes().data()),
          order(tree.order().data()),
          bounds(tree.bounds()),
          max_depth(tree.max_depth()),
          empty(tree.empty()) {}
};

/// A thread's own stack in an array of the caller, for trees of up to `capacity` levels. The array
/// is apart so that its size stays in a register.
template <class Pending, int capacity>
class KdLocalStack {
public:
    RAYDIX_HD explicit KdLocalStack(Pending (&entries)[capacity]) : entries_(entries) {}
    RAYDIX_HD void clear() { size_ = 0; }
    [[nodiscard]] RAYDIX_HD bool empty() const { return size_ == 0; }
    RAYDIX_HD void push(const Pending& pending) {
        RAYDIX_CHECK(size_, <, capacity);
        entries_[size_++] = pending;
    }
    RAYDIX_HD Pending pop() { return entries_[--size_]; }

private:
    Pending* entries_;
    int size_ = 0;
};

/// A node, and how far the query lies outside what is known of its primitives, on each axis.
struct KdDistancePart {
    std::uint32_t slot;
    float off[3];

    /// No point of the node has a smaller d2: |dx| is at least off[0] after rounding, and so on.
    [[nodiscard]] RAYDIX_HD float bound() const {
        return (off[0] * off[0] + off[1] * off[1]) + off[2] * off[2];
    }
    [[nodiscard]] RAYDIX_HD float at(std::uint32_t axis) const {
        return axis == 0 ? off[0] : axis == 1 ? off[1] : off[2];
    }
    /// A child of this node, which lies `gap` off on the axis of the split.
    [[nodiscard]] RAYDIX_HD KdDistancePart child(std::uint32_t child_slot, std::uint32_t axis,
                                                 float gap) const {
        KdDistancePart part = *this;
        part.slot = child_slot;
#if defined(__CUDA_ARCH__)
        // Selects: an array that is indexed at run time would lie in memory.
        if (axis == 0) part.off[0] = max_of(off[0], gap);
        if (axis == 1) part.off[1] = max_of(off[1], gap);
        if (axis == 2) part.off[2] = max_of(off[2], gap);
#else
        part.off[axis] = max_of(off[axis], gap);
#endif
        return part;
    }
};

/// How far q lies outside [lo, hi].
RAYDIX_HD inline float gap(float lo, float hi, float q) {
    return max_of(max_of(lo - q, q - hi), 0.0f);
}

RAYDIX_HD inline float coordinate(Vec3 p, std::uint32_t axis) {
    return axis == 0 ? p.x : axis == 1 ? p.y : p.z;
}

/// The lowest primitive id below a node whose codes are all equal: the sort is stable, so it stands
/// first.
RAYDIX_HD inline std::uint32_t first_id(const KdTreeView& tree, std::uint32_t slot) {
    while (!tree.nodes[slot].is_leaf()) slot = tree.nodes[slot].child();
    return tree.order[tree.nodes[slot].first];
}

/// Whether a node whose points are no nearer than `bound` may hold one that comes before `worst` by
/// (d2, id). Among equal points only ids decide; without that a query would meet every one of them.
RAYDIX_HD inline bool may_improve(const KdTreeView& tree, std::uint32_t slot, float bound,
                                  const KdNeighbor& worst) {
    if (bound != worst.d2) return bound < worst.d2;
    const KdNode& node = tree.nodes[slot];
    if (node.is_leaf() || !node.splits_equal_codes()) return true;
    return first_id(tree, slot) < worst.point;
}

template <class Steps>
concept CountsNodeVisits = requires(Steps steps) {
    ++steps.node_visits;
};

/// `leaf(node)` looks at a leaf's points; `worst()` is what a point must come before to count. The
/// nearer child is visited first. The tree must not be empty.
template <class Stack, class Steps, class Leaf, class Worst>
RAYDIX_HD void walk_kd_tree_outward(const KdTreeView& tree, Vec3 query, Stack& stack, Steps& steps,
                                    const Leaf& leaf, const Worst& worst) {
    const Aabb& box = tree.bounds;
    stack.clear();
    KdDistancePart at{0,
                      {gap(box.lo.x, box.hi.x, query.x), gap(box.lo.y, box.hi.y, query.y),
                       gap(box.lo.z, box.hi.z, query.z)}};
    for (;;) {
        const KdNode node = tree.nodes[at.slot];
        if constexpr (CountsNodeVisits<Steps>) ++steps.node_visits;
        if (node.is_leaf()) {
            leaf(node);
        } else {
            const std::uint32_t axis = node.axis(), slot = node.child();
            const float q = coordinate(query, axis);
            const KdNode &left = tree.nodes[slot], &right = tree.nodes[slot + 1];
            const KdDistancePart a = at.child(slot, axis, gap(left.lo, left.hi, q)),
                                 b = at.child(slot + 1, axis, gap(right.lo, right.hi, q));
            const bool right_first = b.at(axis) < a.at(axis);
            const KdDistancePart near = right_first ? b : a, far = right_first ? a : b;
            if (far.bound() <= worst().d2) stack.push(far);
            if (may_improve(tree, near.slot, near.bound(), worst())) {
                at = near;
                continue;
            }
        }
        do {
            if (stack.empty()) return;
            at = stack.pop();
        } while (!may_improve(tree, at.slot, at.bound(), worst()));
    }
}

}  // namespace raydix
