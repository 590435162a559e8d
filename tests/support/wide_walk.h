// Depth-first walk of one ray through a wide tree with its boxes in float32, nearest child first:
// what the collapse to wide trees is judged by. What happens at a leaf, and how far the ray still
// reaches, is the caller's.
#pragma once

#include <raydix/bvh.h>

#include <cstdint>
#include <vector>

#include "base/check.h"
#include "layout/wide_collapse.h"
#include "trace/slab.h"

namespace raydix {

struct PendingChild {
    const BvhNode* child;
    float entry;
};

/// Room for all siblings of the deepest path (contract.md 2).
class WideStack {
public:
    explicit WideStack(const WideTree& tree)
        : room_(static_cast<std::size_t>(tree.width - 1) * tree.max_depth + 1) {}
    [[nodiscard]] PendingChild* begin() { return room_.data(); }
    [[nodiscard]] std::size_t capacity() const { return room_.size(); }

private:
    std::vector<PendingChild> room_;
};

/// `leaf(child) -> bool` handles a leaf and says whether to stop; `reach()` is the largest t that
/// still matters: a child is skipped only if its padded entry is greater. `steps.visit()` is called
/// for each wide node entered. `bounds`: box of the root. The tree must not be empty.
template <class Steps, class Leaf, class Reach>
void walk_wide(const WideTree& tree, const Aabb& bounds, const RayFrame& ray, WideStack& stack,
               Steps& steps, const Leaf& leaf, const Reach& reach) {
    const SlabFrame slabs = make_slab_frame(ray, bounds);
    PendingChild* const bottom = stack.begin();
    PendingChild* top = bottom;
    const auto enter = [&](std::uint32_t node) {
        steps.visit();
        PendingChild* const own = top;  // those of this node, farthest first
        for (const BvhNode& child : tree.node(node)) {
            if (WideTree::is_unused(child)) break;
            const SlabInterval interval = intersect_slabs(slabs, &child.lo.x, ray.tmin, reach());
            if (!(interval.entry <= interval.exit)) continue;
            RAYDIX_CHECK(static_cast<std::size_t>(top - bottom), <, stack.capacity());
            PendingChild* place = top++;
            for (; place > own && place[-1].entry < interval.entry; --place) *place = place[-1];
            *place = {&child, interval.entry};
        }
    };
    enter(0);
    while (top > bottom) {
        const PendingChild next = *--top;
        if (next.entry > reach()) continue;
        if (WideTree::is_inner(*next.child))
            enter(next.child->first);
        else if (leaf(*next.child))
            return;
    }
}

}  // namespace raydix
