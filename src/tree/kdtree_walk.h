// Visits the nodes of a valid k-d tree in preorder, left child first, without recursion.
#pragma once

#include <raydix/kdtree.h>

#include <cstdint>
#include <span>
#include <vector>

namespace raydix {

/// Calls visit(slot) for every node. In this order the leaves cover the primitive order from 0 to
/// its end. `max_depth` sizes the stack, which never holds more than one node per level and one.
template <class Visit>
void walk_kd_preorder(std::span<const KdNode> nodes, std::uint32_t max_depth, const Visit& visit) {
    if (nodes.empty()) return;
    std::vector<std::uint32_t> waiting;
    waiting.reserve(std::size_t{max_depth} + 1);
    waiting.push_back(0);
    while (!waiting.empty()) {
        const std::uint32_t slot = waiting.back();
        waiting.pop_back();
        visit(slot);
        const KdNode& node = nodes[slot];
        if (node.is_leaf()) continue;
        waiting.push_back(node.child() + 1);
        waiting.push_back(node.child());
    }
}

}  // namespace raydix
