// Walks over octrees that all queries share, and the integer cells of nodes.
#pragma once

#include <raydix/error.h>
#include <raydix/octree.h>

#include <array>
#include <cstdint>
#include <string>

#include "keys/morton.h"

namespace raydix {

/// Throws InputError if there is no such node.
[[nodiscard]] inline const OctreeNode& node_at(const Octree& octree, std::uint32_t node_index) {
    if (node_index >= octree.nodes().size())
        throw InputError("node " + std::to_string(node_index) + " of an octree of " +
                         std::to_string(octree.nodes().size()));
    return octree.nodes()[node_index];
}

/// The cells per axis are 2^this at the finest level of the codes.
[[nodiscard]] inline int axis_bits_of(const Octree& octree) { return octree.options().bits / 3; }

[[nodiscard]] inline Grid grid_of(const Octree& octree) {
    return make_grid(octree.bounds(), axis_bits_of(octree));
}

/// The cell of a node among those of its level.
RAYDIX_HD inline Cell cell_of_code(std::uint64_t code) {
    return {static_cast<std::uint32_t>(gather_bits(code >> 2)),
            static_cast<std::uint32_t>(gather_bits(code >> 1)),
            static_cast<std::uint32_t>(gather_bits(code))};
}

/// The deepest node at `level` or above it on the way to a cell of that level: the node itself, a
/// leaf above it, or the inner node whose octant on the way is empty. The tree is not empty.
[[nodiscard]] inline std::uint32_t descend(const Octree& octree, std::uint64_t code,
                                           std::uint32_t level) {
    const std::span<const OctreeNode> nodes = octree.nodes();
    std::uint32_t at = 0;
    while (nodes[at].level < level) {
        const auto octant =
            static_cast<std::uint32_t>(code >> (3 * (level - nodes[at].level - 1)) & 7u);
        const std::uint32_t child = nodes[at].child(octant);
        if (child == no_node) break;
        at = child;
    }
    return at;
}

/// Visits nodes in preorder, lower octant first, without recursion: visit(node_index) says whether
/// to go on below that node.
template <class Visit>
void walk_octree(const Octree& octree, const Visit& visit) {
    if (octree.empty()) return;
    const std::span<const OctreeNode> nodes = octree.nodes();
    // A level leaves at most seven siblings behind, and the deepest one eight.
    std::array<std::uint32_t, 7 * 22 + 8> waiting;
    std::size_t top = 0;
    waiting[top++] = 0;
    while (top != 0) {
        const std::uint32_t node_index = waiting[--top];
        if (!visit(node_index)) continue;
        const OctreeNode& node = nodes[node_index];
        for (int k = std::popcount(node.child_mask); k-- > 0;)
            waiting[top++] = node.first_child + static_cast<std::uint32_t>(k);
    }
}

}  // namespace raydix
