// Sorted codes [n] -> nodes of a k-d tree: which radix nodes stay, their splits, then how far the
// primitives below each reach (Karras 2012, section 5). One text for every launcher
// (exec/host_launcher.h); slots are numbered by radix index, so the array is the same on all. How
// many keys count, and the grid, are read where the launches run.
#pragma once

#include <raydix/kdtree.h>

#include <cstdint>

#include "base/atomic.h"
#include "base/hd.h"
#include "base/math.h"
#include "base/probe.h"
#include "exec/arena.h"
#include "tree/radix_tree.h"
#include "tree/split_plane.h"

namespace raydix {

/// Inner nodes must leave two bits of a link.
inline constexpr std::uint32_t max_kd_inner = 1u << 30;

RAYDIX_HD inline float component_of(Vec3 v, std::uint32_t axis) {
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

/// What the launches of one build share. `keys` are sorted.
template <class Key>
struct KdKeys {
    const Key* keys;             // [limit]
    std::uint32_t limit;         // at least 1
    const std::uint32_t* count;  // [1]: the first so many count
    const Grid* grid;            // [1]
    std::uint32_t max_leaf;

    template <class Probe>
    [[nodiscard]] RAYDIX_HD SortedKeys<Key, Probe> sorted() const {
        return {keys, *count};
    }
};

/// Scratch of the first launches; `inner` is what they find out.
struct KdRanges {
    RadixRange* ranges;    // [n - 1]
    std::uint32_t* rank;   // [n - 1]: 1 for a node that stays, then how many stay before it
    std::uint32_t* inner;  // [1]

    static KdRanges take(Arena& arena, std::uint32_t n) {
        const std::uint32_t radix_nodes = n - 1;
        return {arena.take<RadixRange>(radix_nodes), arena.take<std::uint32_t>(radix_nodes),
                arena.take<std::uint32_t>(1)};
    }
};

/// Scratch of the others, for up to `inner` inner nodes.
struct KdFitScratch {
    std::uint32_t* parent_slot;  // [inner]: the slot of each inner node
    std::uint8_t* meeting;       // [inner]
    Aabb* boxes;                 // [2 * inner + 2], by slot

    static KdFitScratch take(Arena& arena, std::uint32_t inner) {
        return {arena.take<std::uint32_t>(inner), arena.take<std::uint8_t>(inner),
                arena.take<Aabb>(2 * std::size_t{inner} + 2)};
    }
};

/// Radix node -> its range, and whether it stays an inner node.
template <class Key, class Probe>
struct FindKdRange {
    KdKeys<Key> in;
    KdRanges out;

    RAYDIX_HD void operator()(std::uint32_t node) const {
        const auto keys = in.template sorted<Probe>();
        if (node + 1 >= keys.count) {
            out.rank[node] = 0;
            return;
        }
        const RadixRange range = find_range(keys, node);
        out.ranges[node] = range;
        out.rank[node] = range.last - range.first >= in.max_leaf ? 1u : 0u;
        Probe::bytes(sizeof(RadixRange) + sizeof(std::uint32_t));
    }
};

/// Writes the children of one radix node that stays, but for their intervals.
template <class Key, class Probe>
struct EmitKdNode {
    KdKeys<Key> in;
    KdRanges found;
    KdFitScratch scratch;
    KdNode* nodes;  // [2 * inner + 2], out

    RAYDIX_HD void operator()(std::uint32_t node) const {
        if (node + 1 >= *in.count) return;
        const RadixRange range = found.ranges[node];
        Probe::bytes(sizeof(RadixRange));
        if (range.last - range.first < in.max_leaf) return;
        const std::uint32_t rank = found.rank[node], slot = pair_slot(rank);
        scratch.meeting[rank] = 0;
        child(slot, range.first, range.split, range.split);
        child(slot + 1, range.split + 1, range.last, range.split + 1);
        if (node == 0) {
            inner_node(0, 0);
            nodes[1] = {0.0f, 0.0f, {.first = 0}, 0};
        }
    }

private:
    RAYDIX_HD void child(std::uint32_t slot, std::uint32_t first, std::uint32_t last,
                         std::uint32_t node) const {
        const std::uint32_t count = last - first + 1;
        if (count > in.max_leaf) return inner_node(slot, node);
        nodes[slot] = {0.0f, 0.0f, {.first = first}, count << 2 | KdNode::leaf_axis};
        Probe::bytes(sizeof(KdNode));
    }
    RAYDIX_HD void inner_node(std::uint32_t slot, std::uint32_t node) const {
        const RadixRange range = found.ranges[node];
        const std::uint32_t rank = found.rank[node];
        const int prefix = in.template sorted<Probe>().common_prefix(range.first, range.last);
        const KdSplit split = split_of_prefix<Key>(*in.grid, in.keys[range.split + 1], prefix);
        nodes[slot] = {0.0f, 0.0f, {.plane = split.plane}, rank << 2 | split.axis};
        scratch.parent_slot[rank] = slot;
        Probe::bytes(sizeof(RadixRange) + sizeof(Key) + sizeof(KdNode) + 2 * sizeof(rank));
        Probe::step();
    }
};

/// How far the primitives below each node reach, bottom-up: at each inner node the second child to
/// arrive goes on (Karras 2012, section 4). One work item per inner node: its leaves, then up.
template <class LeafBox, class Probe>
struct FitKdIntervals {
    static constexpr std::uint32_t accesses_per_level = 2;  // meeting, then the sibling's box

    LeafBox leaf_box;  // (first, count) -> box
    KdNode* nodes;     // [2 * inner + 2], intervals are written
    KdFitScratch scratch;
    std::uint32_t* max_depth;  // [1], out

    RAYDIX_HD void operator()(std::uint32_t rank) const {
        const std::uint32_t slot = pair_slot(rank);
        const bool left = nodes[slot].is_leaf(), right = nodes[slot + 1].is_leaf();
        if (left) fit_leaf(slot);
        if (right) fit_leaf(slot + 1);
        Probe::bytes(2 * sizeof(KdNode));
        Probe::step();
        if (left && right) {
            climb(rank, 1);
        } else if (left || right) {
            const std::uint8_t other = arrive(scratch.meeting[rank], std::uint8_t{1});
            Probe::bytes(1);
            Probe::step();
            // The other child's height is other - 1 >= 1: it decides.
            if (other != 0) climb(rank, other);
        }
    }

private:
    RAYDIX_HD void fit_leaf(std::uint32_t slot) const {
        scratch.boxes[slot] = leaf_box(nodes[slot].first, nodes[slot].count());
        Probe::bytes(sizeof(Aabb));
    }
    RAYDIX_HD void set_interval(std::uint32_t slot, std::uint32_t axis) const {
        nodes[slot].lo = component_of(scratch.boxes[slot].lo, axis);
        nodes[slot].hi = component_of(scratch.boxes[slot].hi, axis);
    }
    /// Both children of `rank` have their boxes, and the subtree below it is `height` high.
    RAYDIX_HD void climb(std::uint32_t rank, std::uint32_t height) const {
        for (;;) {
            const std::uint32_t pair = pair_slot(rank), slot = scratch.parent_slot[rank];
            const std::uint32_t axis = nodes[slot].axis();
            set_interval(pair, axis);
            set_interval(pair + 1, axis);
            scratch.boxes[slot] = unite(scratch.boxes[pair], scratch.boxes[pair + 1]);
            Probe::bytes(3 * sizeof(Aabb) + sizeof(slot) + sizeof(KdNode) + 4 * sizeof(float));
            Probe::step();
            if (slot == 0) {
                *max_depth = height;
                // Leaf boxes first, then a turn per level, whichever items took them.
                Probe::chain(2 + height * accesses_per_level);
                return;
            }
            rank = rank_of_slot(slot);
            const std::uint8_t other =
                arrive(scratch.meeting[rank], static_cast<std::uint8_t>(height + 1));
            Probe::bytes(1);
            Probe::step();
            if (other == 0) return;
            height = 1 + (height > other - 1u ? height : other - 1u);
        }
    }
};

/// Up to max_leaf primitives: the root is a leaf. Of none there is a leaf that nobody may read.
template <class Probe>
struct EmitKdRootLeaf {
    const std::uint32_t* primitives;  // [1]
    std::uint32_t max_leaf;
    KdNode* nodes;             // [2], out
    std::uint32_t* max_depth;  // [1], out

    RAYDIX_HD void operator()(std::uint32_t) const {
        const std::uint32_t count = *primitives;
        Probe::bytes(sizeof(count));
        if (count > max_leaf) return;
        nodes[0] = {0.0f, 0.0f, {.first = 0}, count << 2 | KdNode::leaf_axis};
        nodes[1] = {0.0f, 0.0f, {.first = 0}, 0};
        *max_depth = 0;
        Probe::bytes(2 * sizeof(KdNode) + sizeof(std::uint32_t));
    }
};

/// Finds ranges, and how many nodes stay inner ones (in `out.inner`).
template <class Launcher, class Key>
void find_kd_ranges(Launcher& launcher, const KdKeys<Key>& in, const KdRanges& out) {
    using Probe = typename Launcher::Probe;
    launcher.launch("kdtree.ranges", in.limit - 1, FindKdRange<Key, Probe>{in, out});
    launcher.exclusive_scan("kdtree.ranks", out.rank, in.limit - 1, out.inner);
}

/// Writes all nodes and the exact depth. The copies that `leaf_box` reads are in leaf order.
/// nodes [2 * inner + 2]
template <class Launcher, class Key, class LeafBox>
void emit_kd_nodes(Launcher& launcher, const KdKeys<Key>& in, const KdRanges& found,
                   const KdFitScratch& scratch, const LeafBox& leaf_box, KdNode* nodes,
                   std::uint32_t* max_depth) {
    using Probe = typename Launcher::Probe;
    launcher.launch("kdtree.leaf", 1,
                    EmitKdRootLeaf<Probe>{in.count, in.max_leaf, nodes, max_depth});
    launcher.launch("kdtree.emit", in.limit - 1, EmitKdNode<Key, Probe>{in, found, scratch, nodes});
    launcher.launch_counted("kdtree.fit", found.inner, in.limit - 1,
                            FitKdIntervals<LeafBox, Probe>{leaf_box, nodes, scratch, max_depth});
}

}  // namespace raydix
