// Apetrei 2014, "Fast and Simple Agglomerative LBVH Construction": sorted keys [n] + boxes of
// leaves -> links, boxes, parent slots and depth in one bottom-up pass. A climbing item knows the
// range of keys below it; of the keys just outside, its parent's range takes in the one that shares
// more with it. An inner node is named by its split: node s divides its keys between s and s + 1.
#pragma once

#include <cstdint>
#include <type_traits>

#include "base/atomic.h"
#include "tree/fit.h"
#include "tree/lbvh_launches.h"

namespace raydix {

/// In place of leaf boxes: links only.
struct NoLeafBox {};

/// Which splits belong to nodes of more than max_leaf keys. All neighbours below node s share more
/// than keys s and s + 1 do, so its range goes on to either side as long as the key there shares
/// more with the split's key than that; the search looks no further than a leaf may reach (max_leaf
/// <= 255).
template <class Key, class Probe>
struct MarkKeptSplit {
    SortedKeys<Key, Probe> keys;
    std::uint32_t max_leaf;
    std::uint32_t* kept;       // [n], out: 1 for those; 0 for the place behind the last split
    std::uint32_t* other_end;  // [n], out: 0, nobody has arrived

    /// How many keys, `limit` at most, follow `from` in direction d and share more than `here` with
    /// it.
    [[nodiscard]] RAYDIX_HD std::uint32_t reach(std::int64_t from, int d, int here,
                                                std::uint32_t limit) const {
        std::uint32_t length = 0;
        for (std::uint32_t step = 128; step > 0; step /= 2) {
            if (length + step > limit) continue;
            const std::int64_t other = from + d * static_cast<std::int64_t>(length + step);
            if (keys.common_prefix(from, other) > here) length += step;
        }
        return length;
    }

    RAYDIX_HD void operator()(std::uint32_t s) const {
        other_end[s] = 0;
        Probe::bytes(2 * sizeof(std::uint32_t));
        if (s + 1 == keys.count) {
            kept[s] = 0;
            return;
        }
        const int here = keys.common_prefix(s, std::int64_t{s} + 1);
        const std::uint32_t right = 1 + reach(std::int64_t{s} + 1, 1, here, max_leaf - 1);
        const std::uint32_t left = 1 + reach(s, -1, here, max_leaf - 1);
        kept[s] = left + right > max_leaf ? 1 : 0;
    }
};

/// One work item per key; those that begin a leaf climb. Every split that was kept lies between two
/// leaves.
template <class Key, class LeafBox, class Probe>
struct ClimbFromLeaf {
    static constexpr bool fits = !std::is_same_v<LeafBox, NoLeafBox>;
    // A turn of `climb`: two prefixes, the parent's rank, the meeting, the sibling.
    static constexpr std::uint32_t accesses_per_level = 5;

    SortedKeys<Key, Probe> keys;
    const std::uint32_t* rank_of_split;  // [n]
    std::uint32_t* other_end;  // [inner], 0 before; 1 + the outer end of the child that came first
    std::uint8_t* heights;     // [2 * inner + 2], of the subtree in each slot
    LeafBox leaf_box;          // (first, count) -> box, or NoLeafBox
    TreeLinks out;
    std::uint32_t* max_depth;  // [1], out

    [[nodiscard]] RAYDIX_HD bool kept(std::uint32_t split) const {
        Probe::bytes(2 * sizeof(std::uint32_t));
        Probe::step();
        return rank_of_split[split + 1] != rank_of_split[split];
    }

    RAYDIX_HD void operator()(std::uint32_t key) const {
        if (key > 0 && !kept(key - 1)) return;
        std::uint32_t last = key;
        while (last + 1 < keys.count && !kept(last)) ++last;
        BvhNode leaf{{0, 0, 0}, key, {0, 0, 0}, last - key + 1};
        if constexpr (fits) set_box(leaf, leaf_box(leaf.first, leaf.count));
        climb(leaf, key, last);
    }

    /// Puts `node`, all of whose keys are [first, last], below its parent; as the second of two
    /// children, then goes on with the parent.
    RAYDIX_HD void climb(BvhNode node, std::uint32_t first, std::uint32_t last) const {
        for (std::uint32_t height = 0;;) {
            const int before = keys.common_prefix(first, std::int64_t{first} - 1);
            const int behind = keys.common_prefix(last, std::int64_t{last} + 1);
            if (first == 0 && last + 1 == keys.count) {
                put(0, node, height);
                clear_padding(out.nodes);
                *max_depth = height;
                Probe::chain(height * accesses_per_level);
                return;
            }
            const bool is_left = behind > before;
            const std::uint32_t rank = rank_of_split[is_left ? last : first - 1];
            const std::uint32_t slot = pair_slot(rank) + (is_left ? 0 : 1);
            put(slot, node, height);
            const std::uint32_t other = arrive(other_end[rank], (is_left ? first : last) + 1);
            Probe::bytes(2 * sizeof(std::uint32_t));
            Probe::step();
            Probe::step();
            if (other == 0) return;
            (is_left ? last : first) = other - 1;
            const std::uint32_t sibling = slot ^ 1;
            height = 1 + (height > heights[sibling] ? height : heights[sibling]);
            Probe::bytes(1);
            if constexpr (fits) {
                set_box(node, unite(box_of(node), box_of(out.nodes[sibling])));
                Probe::bytes(sizeof(Aabb));
            }
            Probe::step();
            link_inner(node, rank);
        }
    }

    RAYDIX_HD void put(std::uint32_t slot, const BvhNode& node, std::uint32_t height) const {
        if constexpr (fits)
            out.nodes[slot] = node;
        else if (node.is_leaf())
            link_leaf(out.nodes[slot], node.first, node.count);
        else
            link_inner(out.nodes[slot], rank_of_slot(node.first));
        Probe::bytes(fits ? sizeof(BvhNode) : link_bytes);
        heights[slot] = static_cast<std::uint8_t>(height);
        Probe::bytes(1);
        if (node.is_leaf()) return;
        out.parent_slot[rank_of_slot(node.first)] = slot;
        Probe::bytes(sizeof(std::uint32_t));
    }
};

struct ApetreiScratch {
    std::uint32_t* rank_of_split;  // [n]: flags, then ranks
    std::uint32_t* other_end;      // [n]
    std::uint8_t* heights;         // [2 * inner_node_limit + 2]
    ApetreiScratch(Arena& arena, std::uint32_t n, std::uint32_t max_leaf)
        : rank_of_split(arena.take<std::uint32_t>(n)),
          other_end(arena.take<std::uint32_t>(n)),
          heights(arena.take<std::uint8_t>(2 * std::size_t{inner_node_limit(n, max_leaf)} + 2)) {}
};

/// With NoLeafBox boxes are left alone; the depth is exact either way.
template <class Launcher, class Key, class LeafBox>
void launch_apetrei(Launcher& launcher, const LbvhInput<Key>& in, const ApetreiScratch& scratch,
                    const LeafBox& leaf_box, const TreeLinks& out, std::uint32_t* max_depth) {
    using Probe = typename Launcher::Probe;
    const SortedKeys<Key, Probe> keys{in.keys, in.count};
    launcher.launch(
        "apetrei.mark", in.count,
        MarkKeptSplit<Key, Probe>{keys, in.max_leaf, scratch.rank_of_split, scratch.other_end});
    launcher.exclusive_scan("apetrei.rank", scratch.rank_of_split, in.count, out.inner_count);
    launcher.launch(
        "apetrei.climb", in.count,
        ClimbFromLeaf<Key, LeafBox, Probe>{keys, scratch.rank_of_split, scratch.other_end,
                                           scratch.heights, leaf_box, out, max_depth});
}

}  // namespace raydix
