// Walk of one ray through a k-d tree, front to back; kd_outward.h has that of a point. Both keep
// what is left of a node's part of space, narrowed on one axis a level, and skip a node only if
// nothing in it can count: the bounds use the arithmetic of the exact tests, each step of which is
// monotone under rounding.
#pragma once

#include <raydix/kdtree.h>

#include <array>
#include <cstdint>
#include <memory>
#include <type_traits>

#include "base/check.h"
#include "trace/kd_outward.h"
#include "trace/scalar.h"
#include "trace/slab.h"
#include "trace/walk.h"

namespace raydix {

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

}  // namespace raydix
