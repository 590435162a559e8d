// The form that queries read: points in groups of 16, stored by coordinate, and above them nodes of
// 16 boxes each. Everything but the last group and the last node of a level is full, so places
// follow from numbers: child c of node i is node, or group, 16 * i + c of the level below.
#pragma once

#include <raydix/types.h>

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

namespace raydix {

inline constexpr std::uint32_t points_per_leaf = 16, boxes_per_node = 16;
/// 2^31 points are 2^27 groups: 7 levels of nodes.
inline constexpr std::uint32_t max_point_levels = 7;

template <class T, int Dim>
struct alignas(64) PointLeaf {
    T at[Dim][points_per_leaf];         // NaN behind the last point
    std::uint32_t id[points_per_leaf];  // no_primitive behind the last point
};

/// The boxes of 16 children; those behind the last child have lo = hi = 0 and are never looked at.
template <class T, int Dim>
struct alignas(64) PointNode {
    T lo[Dim][boxes_per_node];
    T hi[Dim][boxes_per_node];
};

/// Pointers to a tree. `levels` = 0: no points.
template <class T, int Dim>
struct PointTreeView {
    const PointLeaf<T, Dim>* leaves = nullptr;
    const PointNode<T, Dim>* nodes = nullptr;  // those above the leaves first, the root last
    const std::uint32_t* lowest_ids = nullptr;  // [node][child]: the lowest id below it
    std::uint32_t points = 0, levels = 0;
    /// Where the nodes of a level begin, and how many children they have together.
    std::array<std::uint32_t, max_point_levels> start{}, children{};

    [[nodiscard]] bool empty() const { return levels == 0; }
    /// Bit c: child c of a node is there.
    [[nodiscard]] std::uint32_t child_mask(std::uint32_t level, std::uint32_t node) const {
        const std::uint32_t left = children[level] - node * boxes_per_node;
        return left >= boxes_per_node ? 0xFFFFu : (1u << left) - 1;
    }
    /// How many points lie below child `child` of all children of a level.
    [[nodiscard]] std::uint32_t points_below(std::uint32_t level, std::uint32_t child) const {
        const std::uint64_t each = std::uint64_t{points_per_leaf} << 4 * level;
        const std::uint64_t begin = child * each, rest = points - begin;
        return static_cast<std::uint32_t>(rest < each ? rest : each);
    }
};

/// Whether (d2, id) orders like the unsigned number it gives: floats that are not negative are in
/// the order of their bits.
[[nodiscard]] inline std::uint64_t nearness_key(float d2, std::uint32_t id) {
    return std::uint64_t{std::bit_cast<std::uint32_t>(d2)} << 32 | id;
}

}  // namespace raydix
