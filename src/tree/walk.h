// Visits the nodes of a valid tree in preorder, left child first, without recursion.
#pragma once

#include <raydix/bvh.h>

#include <cstdint>
#include <span>
#include <vector>

namespace raydix {

/// Calls visit(node_index) for every node. In this order the leaves cover the primitive order from
/// 0 to its end. `max_depth` sizes the stack, which never holds more than one node per level and
/// one.
template <class Visit>
void walk_preorder(std::span<const BvhNode> nodes, std::uint32_t max_depth, const Visit& visit) {
    if (nodes.empty()) return;
    std::vector<std::uint32_t> waiting;
    waiting.reserve(std::size_t{max_depth} + 1);
    waiting.push_back(0);
    while (!waiting.empty()) {
        const std::uint32_t node_index = waiting.back();
        waiting.pop_back();
        visit(node_index);
        const BvhNode& node = nodes[node_index];
        if (node.is_leaf()) continue;
        waiting.push_back(node.first + 1);
        waiting.push_back(node.first);
    }
}

/// Node -> the first position of the primitive order below it.
inline std::vector<std::uint32_t> first_positions(const Bvh& bvh) {
    std::vector<std::uint32_t> begin(bvh.nodes().size());
    std::uint32_t position = 0;
    walk_preorder(bvh.nodes(), bvh.max_depth(), [&](std::uint32_t node_index) {
        begin[node_index] = position;
        position += bvh.nodes()[node_index].count;
    });
    return begin;
}

}  // namespace raydix
