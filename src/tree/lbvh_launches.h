// What the builders of the LBVH family read and write when they run as launches
// (exec/host_launcher.h): sorted keys [n] -> links of nodes [2 * inner + 2] and parent slots
// [inner]. Boxes come later. All arrays lie in the launcher's memory.
#pragma once

#include <raydix/bvh.h>

#include <cstddef>
#include <cstdint>

#include "base/hd.h"
#include "exec/arena.h"
#include "tree/radix_tree.h"

namespace raydix {

template <class Key>
struct LbvhInput {
    const Key* keys;         // [count], sorted
    std::uint32_t count;     // at least 1
    std::uint32_t max_leaf;  // subtrees of up to so many keys become leaves
};

/// The most inner nodes that n keys can have: each holds more than max_leaf keys, fewer than the
/// one above it.
[[nodiscard]] constexpr std::uint32_t inner_node_limit(std::uint32_t n, std::uint32_t max_leaf) {
    return n > max_leaf ? n - max_leaf : 0;
}

struct TreeLinks {
    BvhNode* nodes;              // [2 * inner_node_limit + 2], out: `first` and `count`
    std::uint32_t* parent_slot;  // [inner_node_limit], out; 0 for the root
    std::uint32_t* inner_count;  // [1], out
};

/// The inner nodes in an order in which each stands on a later level than its parent: those of
/// level l are ranks[begin[l]], ... or, where `ranks` is null, the ranks from begin[l] on.
struct TreeLevels {
    std::uint32_t* begin;        // [limit + 1]
    std::uint32_t* count;        // [limit + 1], 0 for empty levels
    std::uint32_t limit;         // no more levels than this
    const std::uint32_t* ranks;  // [inner] or null
};

/// The most nodes on a level (0: the root's) of a tree of `inner` inner nodes.
[[nodiscard]] constexpr std::uint32_t level_size_limit(std::uint32_t level, std::uint32_t inner) {
    return level < 31 && (std::uint32_t{1} << level) < inner ? std::uint32_t{1} << level : inner;
}

RAYDIX_HD inline void link_leaf(BvhNode& node, std::uint32_t first, std::uint32_t count) {
    node.first = first;
    node.count = count;
}
RAYDIX_HD inline void link_inner(BvhNode& node, std::uint32_t rank) {
    node.first = pair_slot(rank);
    node.count = 0;
}
inline constexpr std::uint64_t link_bytes = 2 * sizeof(std::uint32_t);

/// The slot beside the root, which only keeps pairs of children in one line.
RAYDIX_HD inline void clear_padding(BvhNode* nodes) {
    nodes[1] = BvhNode{{0, 0, 0}, 0, {0, 0, 0}, 0};
}

/// The whole tree of n <= max_leaf keys.
struct EmitOnlyLeaf {
    std::uint32_t key_count;
    TreeLinks out;
    RAYDIX_HD void operator()(std::uint32_t) const {
        link_leaf(out.nodes[0], 0, key_count);
        clear_padding(out.nodes);
        *out.inner_count = 0;
    }
};

/// The split of keys [first, last]: the last key that shares more with the first than the last one
/// does.
template <class Key, class Probe>
RAYDIX_HD std::uint32_t find_split(const SortedKeys<Key, Probe>& keys, std::uint32_t first,
                                   std::uint32_t last) {
    const int shared = keys.common_prefix(first, last);
    std::uint32_t low = first, high = last;
    while (high - low > 1) {
        const std::uint32_t middle = low + (high - low) / 2;
        if (keys.common_prefix(first, middle) > shared)
            low = middle;
        else
            high = middle;
    }
    return low;
}

/// Bytes that a scratch struct takes from an arena; the arguments are those of its constructor
/// behind the arena.
template <class Scratch, class... Sizes>
[[nodiscard]] std::size_t scratch_bytes(Sizes... sizes) {
    Arena query;
    Scratch{query, sizes...};
    return query.bytes();
}

}  // namespace raydix
