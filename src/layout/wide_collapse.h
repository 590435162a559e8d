// Any binary tree -> a tree of up to `width` children a node, of the least cost that the surface
// area heuristic can give it (Ylitie, Karras, Laine 2017, section 3.1): dynamic programming over
// the binary tree. Tree of 32-byte nodes -> children [wide nodes][width].
#pragma once

#include <raydix/buffer.h>
#include <raydix/bvh.h>

#include <cstdint>
#include <span>

namespace raydix {

struct WideOptions {
    int width = 8;                // 4 or 8 children a node at most
    std::uint32_t max_leaf = 3;   // primitives of a leaf at most; larger leaves are divided
    double node_cost = 1.0;       // of visiting a wide node, against ...
    double primitive_cost = 1.0;  // ... testing one primitive
    std::uint32_t block = 1;      // so many primitives are tested at the cost of one
    bool compact = false;         // WideBvh alone: corners by way of a list of vertices
};

/// Node w has the children [w * width, (w + 1) * width), used ones first, by ascending search_rank
/// (search_odds.h). A child is a BvhNode: an inner one has count == 0 and `first` is its wide node,
/// a leaf holds the positions [first, first + count) of the tree's order, an unused one has count
/// == 0 and first == no_child. The root is node 0; the inner children of a node are consecutive
/// nodes, in the order of its children, and come after it.
struct WideTree {
    static constexpr std::uint32_t no_child = ~std::uint32_t{0};

    int width = 0;
    std::uint32_t max_depth = 0;  // edges from the root to the deepest leaf, exact; 0 without nodes
    Buffer<BvhNode> children;

    [[nodiscard]] std::uint32_t node_count() const {
        return width == 0
                   ? 0
                   : static_cast<std::uint32_t>(children.size() / static_cast<std::size_t>(width));
    }
    [[nodiscard]] std::span<const BvhNode> node(std::uint32_t w) const {
        const auto n = static_cast<std::size_t>(width);
        return children.view().subspan(w * n, n);
    }
    [[nodiscard]] static bool is_inner(const BvhNode& child) {
        return child.count == 0 && child.first != no_child;
    }
    [[nodiscard]] static bool is_unused(const BvhNode& child) {
        return child.count == 0 && child.first == no_child;
    }
};

/// O(references * width) time, the same tree for every thread count. References may be more than
/// primitives. Throws InputError for another width, or max_leaf 0.
[[nodiscard]] WideTree collapse_to_wide(const Bvh& bvh, const WideOptions& options = {});

/// Throws InputError for another width, or a limit of 0.
void check_wide_options(const WideOptions& options);

/// Cost of the tree in units of node_cost * the root's area: what the collapse makes least. 0 if
/// the root has no area.
[[nodiscard]] double wide_cost(const WideTree& tree, const WideOptions& options);

}  // namespace raydix
