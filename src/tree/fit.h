// Boxes bottom-up in one parallel pass: leaves climb, and at each inner node the second child to
// arrive goes on (Karras 2012, section 4). Links + leaf boxes -> boxes of all nodes, and the exact
// depth.
#pragma once

#include <raydix/bvh.h>

#include <cstdint>

#include "base/atomic.h"
#include "base/hd.h"
#include "base/math.h"
#include "base/probe.h"
#include "tree/radix_tree.h"

namespace raydix {

RAYDIX_HD inline void set_box(BvhNode& node, const Aabb& box) {
    node.lo = box.lo;
    node.hi = box.hi;
}
RAYDIX_HD inline Aabb box_of(const BvhNode& node) { return {node.lo, node.hi}; }

/// One work item per inner node: boxes of those children that are leaves, then up as far as it is
/// the second to come.
template <class LeafBox, class Probe = NoProbe>
struct FitBoxes {
    static constexpr std::uint32_t accesses_per_level = 2;  // meeting, then the sibling's box

    LeafBox leaf_box;                  // (first, count) -> box
    BvhNode* nodes;                    // [2 * inner + 2], boxes are written
    const std::uint32_t* parent_slot;  // [inner]
    std::uint8_t* meeting;     // [inner], zero before; 1 + the height of the child that came first
    std::uint32_t* max_depth;  // [1], out

    RAYDIX_HD void operator()(std::uint32_t rank) const {
        BvhNode* pair = nodes + pair_slot(rank);
        const bool left = pair[0].is_leaf(), right = pair[1].is_leaf();
        Probe::bytes(4 * sizeof(std::uint32_t) + (std::uint64_t{left} + right) * sizeof(Aabb));
        Probe::step();
        if (left) set_box(pair[0], leaf_box(pair[0].first, pair[0].count));
        if (right) set_box(pair[1], leaf_box(pair[1].first, pair[1].count));
        if (left && right) {
            climb(rank, 1);
        } else if (left || right) {
            const std::uint8_t other = arrive(meeting[rank], 1);
            Probe::bytes(1);
            Probe::step();
            if (other != 0)
                climb(rank, other);  // the other child's height is other - 1 >= 1: it decides
        }
    }

    /// Both children of `rank` are done, and the subtree below it is `height` high.
    RAYDIX_HD void climb(std::uint32_t rank, std::uint32_t height) const {
        for (;;) {
            const BvhNode* pair = nodes + pair_slot(rank);
            const std::uint32_t slot = parent_slot[rank];
            set_box(nodes[slot], unite(box_of(pair[0]), box_of(pair[1])));
            Probe::bytes(sizeof(std::uint32_t) + 3 * sizeof(Aabb));
            Probe::step();
            if (slot == 0) {
                *max_depth = height;
                // Leaf boxes first, then a turn per level, whichever items took them.
                Probe::chain(2 + height * accesses_per_level);
                return;
            }
            rank = rank_of_slot(slot);
            const std::uint8_t other = arrive(meeting[rank], static_cast<std::uint8_t>(height + 1));
            Probe::bytes(1);
            Probe::step();
            if (other == 0) return;
            height = 1 + (height > other - 1u ? height : other - 1u);
        }
    }
};

struct ClearMeeting {
    std::uint8_t* meeting;
    RAYDIX_HD void operator()(std::uint32_t rank) const { meeting[rank] = 0; }
};

/// The tree that has no inner node.
template <class LeafBox>
struct FitOnlyLeaf {
    LeafBox leaf_box;
    BvhNode* nodes;
    std::uint32_t* max_depth;
    RAYDIX_HD void operator()(std::uint32_t) const {
        set_box(nodes[0], leaf_box(nodes[0].first, nodes[0].count));
        *max_depth = 0;
    }
};

/// Boxes of a tree of *inner_count <= inner_limit inner nodes, at least one. `meeting` has
/// inner_limit bytes.
template <class Launcher, class LeafBox>
void launch_fit_atomic(Launcher& launcher, const LeafBox& leaf_box, BvhNode* nodes,
                       const std::uint32_t* parent_slot, const std::uint32_t* inner_count,
                       std::uint32_t inner_limit, std::uint8_t* meeting, std::uint32_t* max_depth) {
    launcher.launch_counted("fit.clear", inner_count, inner_limit, ClearMeeting{meeting});
    launcher.launch_counted("fit.climb", inner_count, inner_limit,
                            FitBoxes<LeafBox, typename Launcher::Probe>{
                                leaf_box, nodes, parent_slot, meeting, max_depth});
}

}  // namespace raydix
