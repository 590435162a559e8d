// Boxes level by level, one launch a level from the deepest up, as the LBVH builders before Karras
// 2012 have it: links and parent slots + leaf boxes -> boxes of all nodes and the exact depth.
// Levels come from the builder, or are found by walking down from the root.
#pragma once

#include <cstdint>

#include "base/atomic.h"
#include "tree/fit.h"
#include "tree/lbvh_launches.h"

namespace raydix {

/// The root alone is on the first level; a tree of one leaf has none.
struct StartLevels {
    const BvhNode* nodes;
    std::uint32_t* ranks;
    TreeLevels levels;
    RAYDIX_HD void operator()(std::uint32_t level) const {
        levels.count[level] = level == 0 && !nodes[0].is_leaf() ? 1 : 0;
        if (level != 0) return;
        levels.begin[0] = 0;
        if (nodes[0].is_leaf()) return;
        ranks[0] = rank_of_slot(nodes[0].first);
    }
};

/// Puts the inner children of one node of `level` on the next.
template <class Probe>
struct ExpandLevel {
    const BvhNode* nodes;
    std::uint32_t* ranks;
    TreeLevels levels;
    std::uint32_t level;
    RAYDIX_HD void operator()(std::uint32_t i) const {
        const std::uint32_t begin = levels.begin[level], end = begin + levels.count[level];
        const BvhNode* pair = nodes + pair_slot(ranks[begin + i]);
        const bool left = !pair[0].is_leaf(), right = !pair[1].is_leaf();
        Probe::bytes(sizeof(std::uint32_t) + 2 * link_bytes);
        Probe::step();
        Probe::step();
        if (left || right) {
            const auto more = static_cast<std::uint32_t>(left) + right;
            std::uint32_t place = end + claim(levels.count[level + 1], more);
            if (left) ranks[place++] = rank_of_slot(pair[0].first);
            if (right) ranks[place] = rank_of_slot(pair[1].first);
            Probe::bytes((1 + more) * sizeof(std::uint32_t));
            Probe::step();
        }
        if (i == 0) levels.begin[level + 1] = end;
    }
};

/// Fits one node of `level`, and its children that are leaves; inner ones were on a later level.
template <class LeafBox, class Probe>
struct FitLevel {
    LeafBox leaf_box;
    BvhNode* nodes;
    const std::uint32_t* parent_slot;
    TreeLevels levels;
    std::uint32_t level;
    std::uint16_t* heights;    // [inner], out
    std::uint32_t* max_depth;  // [1], out

    [[nodiscard]] RAYDIX_HD std::uint32_t finish(BvhNode& child) const {
        if (!child.is_leaf()) {
            Probe::bytes(sizeof(std::uint16_t));
            return heights[rank_of_slot(child.first)];
        }
        set_box(child, leaf_box(child.first, child.count));
        Probe::bytes(sizeof(Aabb));
        return 0;
    }

    RAYDIX_HD void operator()(std::uint32_t i) const {
        const std::uint32_t at = levels.begin[level] + i;
        std::uint32_t rank = at;
        if (levels.ranks != nullptr) {
            rank = levels.ranks[at];
            Probe::bytes(sizeof(std::uint32_t));
            Probe::step();
        }
        BvhNode* pair = nodes + pair_slot(rank);
        const std::uint32_t slot = parent_slot[rank];
        Probe::bytes(2 * sizeof(BvhNode) + sizeof(std::uint32_t));
        Probe::step();
        const std::uint32_t left = finish(pair[0]), right = finish(pair[1]);
        Probe::step();
        const std::uint32_t height = 1 + (left > right ? left : right);
        set_box(nodes[slot], unite(box_of(pair[0]), box_of(pair[1])));
        heights[rank] = static_cast<std::uint16_t>(height);
        Probe::bytes(sizeof(Aabb) + sizeof(std::uint16_t));
        if (slot == 0) *max_depth = height;
    }
};

struct FitLevelsScratch {
    std::uint16_t* heights;  // [inner]
    explicit FitLevelsScratch(Arena& arena, std::uint32_t inner)
        : heights(arena.take<std::uint16_t>(inner)) {}
};

/// Finds the levels of any tree of this node format that has an inner node. `ranks` [inner] and
/// `levels` are filled; `levels.limit` must not be less than the tree's depth.
template <class Launcher>
TreeLevels launch_find_levels(Launcher& launcher, const BvhNode* nodes, std::uint32_t inner_limit,
                              std::uint32_t* ranks, TreeLevels levels) {
    using Probe = typename Launcher::Probe;
    levels.ranks = ranks;
    launcher.launch("fit.start", levels.limit + 1, StartLevels{nodes, ranks, levels});
    for (std::uint32_t level = 0; level < levels.limit; ++level) {
        if (!launcher.maybe_any(levels.count + level)) break;
        launcher.launch_counted("fit.find_level", levels.count + level,
                                level_size_limit(level, inner_limit),
                                ExpandLevel<Probe>{nodes, ranks, levels, level});
    }
    return levels;
}

/// For trees with an inner node that are at most 65,535 deep.
template <class Launcher, class LeafBox>
void launch_fit_levels(Launcher& launcher, const LeafBox& leaf_box, BvhNode* nodes,
                       const std::uint32_t* parent_slot, std::uint32_t inner_limit,
                       const TreeLevels& levels, const FitLevelsScratch& scratch,
                       std::uint32_t* max_depth) {
    using Probe = typename Launcher::Probe;
    for (std::uint32_t level = levels.limit; level-- > 0;) {
        if (!launcher.maybe_any(levels.count + level)) continue;
        launcher.launch_counted("fit.level", levels.count + level,
                                level_size_limit(level, inner_limit),
                                FitLevel<LeafBox, Probe>{leaf_box, nodes, parent_slot, levels,
                                                         level, scratch.heights, max_depth});
    }
}

}  // namespace raydix
