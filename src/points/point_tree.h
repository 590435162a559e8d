// The form that queries read: points in groups of 16, stored by coordinate, and above them nodes of
// up to 16 boxes. The children of a node lie side by side: groups below a bottom node, nodes below
// the others.
#pragma once

#include <raydix/types.h>

#include <bit>
#include <cstddef>
#include <cstdint>

namespace raydix {

inline constexpr std::uint32_t points_per_leaf = 16, boxes_per_node = 16;
/// Nodes on a path from the root; build_tree.cpp sees to it. Uniform points need one for each
/// factor of 16, points that come closer by halves, down to the least float, about 70.
inline constexpr std::uint32_t max_point_depth = 96;

template <class T, int Dim>
struct alignas(64) PointLeaf {
    T at[Dim][points_per_leaf];         // NaN behind the last point
    std::uint32_t id[points_per_leaf];  // no_primitive behind the last point
};

template <class T, int Dim>
struct alignas(64) PointNode {
    T lo[Dim][boxes_per_node];  // of the children; 0 behind the last
    T hi[Dim][boxes_per_node];
    std::uint32_t below;                                  // the first child: a group or a node
    std::uint32_t children;                               // how many
    std::uint32_t is_bottom;                              // 1: they are groups
    alignas(64) std::uint32_t lowest_id[boxes_per_node];  // below each child
    std::uint32_t points[boxes_per_node];                 // below each child

    /// Bit c: child c is there.
    [[nodiscard]] std::uint32_t child_mask() const { return (1u << children) - 1; }
};

/// Pointers to a tree; nodes[0] is the root.
template <class T, int Dim>
struct PointTreeView {
    const PointLeaf<T, Dim>* leaves = nullptr;
    const PointNode<T, Dim>* nodes = nullptr;
    std::uint32_t points = 0, leaf_count = 0, node_count = 0;
    std::uint32_t depth = 0;  // nodes from the root to the deepest, both included

    [[nodiscard]] bool empty() const { return points == 0; }
};

/// Whether (d2, id) orders like the unsigned number it gives: floats that are not negative are in
/// the order of their bits.
[[nodiscard]] inline std::uint64_t nearness_key(float d2, std::uint32_t id) {
    return std::uint64_t{std::bit_cast<std::uint32_t>(d2)} << 32 | id;
}

}  // namespace raydix
