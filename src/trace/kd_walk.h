// Walks through a k-d tree: one ray front to back, or one point outward from where it lies. Both
// keep what is left of a node's part of space, narrowed on one axis a level, and skip a node only
// if nothing in it can count: the bounds use the arithmetic of the exact tests, each step of which
// is monotone under rounding.
#pragma once

#include <raydix/kdtree.h>

#include <array>
#include <cstdint>
#include <memory>
#include <type_traits>

#include "base/check.h"
#include "trace/scalar.h"
#include "trace/slab.h"
#include "trace/walk.h"

namespace raydix {

/// What walks read, without going through the KdTree each time.
struct KdTreeView {
    const KdNode* nodes;
    const std::uint32_t* order;
    Aabb bounds;
    std::uint32_t max_depth;
    bool empty;

    explicit KdTreeView(const KdTree& tree)
        : nodes(tree.nodes().data()),
          order(tree.order().data()),
          bounds(tree.bounds()),
          max_depth(tree.max_depth()),
          empty(tree.empty()) {}
};

/// Room for one pending sibling per level of the deepest path: no walk can run over.
template <class Pending>
class KdStack {
public:
    explicit KdStack(std::uint32_t max_depth)
        : entries_(std::make_unique_for_overwrite<Pending[]>(max_depth)), capacity_(max_depth) {}
    void clear() { size_ = 0; }
    [[nodiscard]] bool empty() const { return size_ == 0; }
    void push(const Pending& pending) {
        RAYDIX_CHECK(size_, <, capacity_);
        entries_[size_++] = pending;
    }
    Pending pop() { return entries_[--size_]; }

private:
    std::unique_ptr<Pending[]> entries_;
    std::uint32_t size_ = 0, capacity_;
};

/// A node, and the part of the ray inside it.
struct KdRayPart {
    std::uint32_t slot;
    float entry, exit;
};

/// The slabs of slab.h, one axis of them.
struct AxisSlab {
    float origin, inverse, near_pad, far_pad;
    bool downward;  // the ray runs toward lower coordinates

    /// `part` cut down to the node's interval. 0 * Inf, a plane that holds a ray parallel to it, is
    /// NaN, and comparisons drop it.
    [[nodiscard]] KdRayPart inside(const KdNode& node, std::uint32_t slot,
                                   const KdRayPart& part) const {
        const float near = downward ? node.hi : node.lo, far = downward ? node.lo : node.hi;
        const float entry = ((near - origin) + near_pad) * inverse;
        const float leave = ((far - origin) + far_pad) * inverse * slab_exit_factor;
        return {slot, max_of(entry, part.entry), min_of(leave, part.exit)};
    }
};

inline std::array<AxisSlab, 3> axis_slabs(const SlabFrame& ray) {
    return {{{ray.origin.x, ray.inverse.x, ray.near_pad.x, ray.far_pad.x, ray.near_x != 0},
             {ray.origin.y, ray.inverse.y, ray.near_pad.y, ray.far_pad.y, ray.near_y != 0},
             {ray.origin.z, ray.inverse.z, ray.near_pad.z, ray.far_pad.z, ray.near_z != 0}}};
}

/// `leaf(node) -> bool` handles a leaf and says whether to stop; `reach()` is the largest t that
/// still matters: a node is skipped only if its padded entry is greater. The tree must not be
/// empty. The child on the side that the ray comes from is visited first.
template <class Steps, class Leaf, class Reach>
void walk_kd_tree(const KdTreeView& tree, const RayFrame& ray, KdStack<KdRayPart>& stack,
                  Steps& steps, const Leaf& leaf, const Reach& reach) {
    const SlabFrame slabs = make_slab_frame(ray, tree.bounds);
    const Vec3 lo = tree.bounds.lo, hi = tree.bounds.hi;
    const float root_box[] = {lo.x, lo.y, lo.z, 0.0f, hi.x, hi.y, hi.z, 0.0f};
    const SlabInterval whole = intersect_slabs(slabs, root_box, ray.tmin, reach());
    if (!(whole.entry <= whole.exit)) return;
    const std::array<AxisSlab, 3> axes = axis_slabs(slabs);
    stack.clear();
    KdRayPart at{0, whole.entry, whole.exit};
    for (;;) {
        const KdNode& node = tree.nodes[at.slot];
        if constexpr (!std::is_same_v<Steps, NoSteps>) ++steps.node_visits;
        if (node.is_leaf()) {
            if (leaf(node)) return;
        } else {
            const AxisSlab& axis = axes[node.axis()];
            const std::uint32_t near_slot = node.child() + (axis.downward ? 1 : 0),
                                far_slot = node.child() + (axis.downward ? 0 : 1);
            const KdRayPart near = axis.inside(tree.nodes[near_slot], near_slot, at);
            const KdRayPart far = axis.inside(tree.nodes[far_slot], far_slot, at);
            const float limit = reach();
            const bool go_near = near.entry <= min_of(near.exit, limit),
                       go_far = far.entry <= min_of(far.exit, limit);
            if (go_near && go_far) stack.push(far);
            if (go_near || go_far) {
                at = go_near ? near : far;
                continue;
            }
        }
        do {
            if (stack.empty()) return;
            at = stack.pop();
        } while (at.entry > reach());
    }
}

/// A node, and how far the query lies outside what is known of its primitives, on each axis.
struct KdDistancePart {
    std::uint32_t slot;
    std::array<float, 3> off;

    /// No point of the node has a smaller d2: |dx| is at least off[0] after rounding, and so on.
    [[nodiscard]] float bound() const {
        return (off[0] * off[0] + off[1] * off[1]) + off[2] * off[2];
    }
};

/// How far q lies outside [lo, hi].
inline float gap(float lo, float hi, float q) { return max_of(max_of(lo - q, q - hi), 0.0f); }

/// The lowest primitive id below a node whose codes are all equal: the sort is stable, so it stands
/// first.
inline std::uint32_t first_id(const KdTreeView& tree, std::uint32_t slot) {
    while (!tree.nodes[slot].is_leaf()) slot = tree.nodes[slot].child();
    return tree.order[tree.nodes[slot].first];
}

/// Whether a node whose points are no nearer than `bound` may hold one that comes before `worst` by
/// (d2, id). Among equal points only ids decide; without that a query would meet every one of them.
inline bool may_improve(const KdTreeView& tree, std::uint32_t slot, float bound,
                        const KdNeighbor& worst) {
    if (bound != worst.d2) return bound < worst.d2;
    const KdNode& node = tree.nodes[slot];
    if (node.is_leaf() || !node.splits_equal_codes()) return true;
    return first_id(tree, slot) < worst.point;
}

/// `leaf(node)` looks at a leaf's points; `worst()` is what a point must come before to count. The
/// nearer child is visited first. The tree must not be empty.
template <class Steps, class Leaf, class Worst>
void walk_kd_tree_outward(const KdTreeView& tree, Vec3 query, KdStack<KdDistancePart>& stack,
                          Steps& steps, const Leaf& leaf, const Worst& worst) {
    const std::array<float, 3> q{query.x, query.y, query.z};
    const Aabb& box = tree.bounds;
    stack.clear();
    KdDistancePart at{0,
                      {gap(box.lo.x, box.hi.x, q[0]), gap(box.lo.y, box.hi.y, q[1]),
                       gap(box.lo.z, box.hi.z, q[2])}};
    for (;;) {
        const KdNode& node = tree.nodes[at.slot];
        if constexpr (!std::is_same_v<Steps, NoSteps>) ++steps.node_visits;
        if (node.is_leaf()) {
            leaf(node);
        } else {
            const std::uint32_t axis = node.axis(), slot = node.child();
            const KdNode &left = tree.nodes[slot], &right = tree.nodes[slot + 1];
            KdDistancePart a = at, b = at;
            a.slot = slot;
            b.slot = slot + 1;
            a.off[axis] = max_of(at.off[axis], gap(left.lo, left.hi, q[axis]));
            b.off[axis] = max_of(at.off[axis], gap(right.lo, right.hi, q[axis]));
            const bool right_first = b.off[axis] < a.off[axis];
            const KdDistancePart& near = right_first ? b : a;
            const KdDistancePart& far = right_first ? a : b;
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
