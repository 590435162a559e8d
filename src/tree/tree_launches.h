// Sorted keys [n] + leaf boxes -> links and boxes of nodes, by any builder of the LBVH family, as
// launches for any backend. How many of the n keys count is known where the launches run, not to
// the host.
#pragma once

#include <raydix/bvh.h>
#include <raydix/error.h>

#include <algorithm>
#include <cstdint>
#include <string>

#include "exec/arena.h"
#include "tree/apetrei.h"
#include "tree/climb_warps.h"
#include "tree/device_key_count.h"
#include "tree/fit.h"
#include "tree/fit_levels.h"
#include "tree/garanzha.h"
#include "tree/hierarchy.h"
#include "tree/karras_launches.h"
#include "tree/lauterbach.h"
#include "tree/lbvh_family.h"

namespace raydix {

/// How a device goes through the leaves of karras unless told otherwise.
[[nodiscard]] constexpr bool climbs_in_warps(const BuildOptions& options) {
    return options.builder == Builder::karras && options.fit == Fit::as_published;
}

/// Scratch of a fit, and what it shares with the builder.
struct TreeScratch {
    KeyCounts* key_counts;
    std::uint32_t* parent_slot;
    TreeLevels levels;
    std::uint32_t* ranks;  // of a fit by levels, which may have to find them
    FitLevelsScratch by_levels;
    std::uint8_t* meeting;     // of a fit in one pass
    std::uint32_t* leaf_slot;  // of a climb in warps
    std::uint8_t* leaf_count;
    std::uint32_t* kept;

    TreeScratch(Arena& arena, std::uint32_t n, const BuildOptions& options)
        : TreeScratch(arena, inner_node_limit(n, static_cast<std::uint32_t>(options.max_leaf)),
                      lbvh_depth_bound(options.bits, std::max(n, 1u)), fits_by_levels(options),
                      climbs_in_warps(options) ? n : 0, options.max_leaf > 1) {}

private:
    TreeScratch(Arena& arena, std::uint32_t inner, std::uint32_t level_limit, bool fit_levels,
                std::uint32_t leaves, bool many_in_leaf)
        : key_counts(arena.take<KeyCounts>(1)),
          parent_slot(arena.take<std::uint32_t>(inner)),
          levels{arena.take<std::uint32_t>(level_limit + 1),
                 arena.take<std::uint32_t>(level_limit + 1), level_limit, nullptr},
          ranks(arena.take<std::uint32_t>(fit_levels ? inner : 0)),
          by_levels(arena, fit_levels ? inner : 0),
          meeting(arena.take<std::uint8_t>(fit_levels ? 0 : inner)),
          leaf_slot(arena.take<std::uint32_t>(leaves)),
          leaf_count(arena.take<std::uint8_t>(many_in_leaf ? leaves : 0)),
          kept(arena.take<std::uint32_t>(many_in_leaf ? leaves : 0)) {}
};

/// A tree of no more keys than a leaf may hold, which the builders leave to those who know it. Of
/// an empty one the root is a leaf that nobody may read.
struct LinkFewKeys {
    const std::uint32_t* key_count;
    std::uint32_t max_leaf;
    TreeLinks out;
    RAYDIX_HD void operator()(std::uint32_t) const {
        const std::uint32_t n = *key_count;
        if (n <= max_leaf) EmitOnlyLeaf{n > 0 ? n : 1, out}(0);
    }
};

/// The box of a tree that is one leaf, if it is.
template <class LeafBox>
struct FitIfOnlyLeaf {
    FitOnlyLeaf<LeafBox> fit;
    const std::uint32_t *key_count, *inner_count;
    RAYDIX_HD void operator()(std::uint32_t) const {
        if (*key_count == 0) *fit.max_depth = 0;
        if (*key_count != 0 && *inner_count == 0) fit(0);
    }
};

/// What the stages behind the sort read and write.
template <class Key>
struct TreeRun {
    const Key* keys;                 // [capacity], sorted
    std::uint32_t capacity;          // at least 1
    const std::uint32_t* key_count;  // [1], at most `capacity`
    BuildOptions options;
    TreeLinks out;
    std::uint32_t* max_depth;  // [1]
};

[[nodiscard]] constexpr bool fits_while_building(const BuildOptions& options) {
    return options.builder == Builder::apetrei && options.fit == Fit::as_published;
}

template <class Key>
ParentSlots parent_slots(const TreeRun<Key>& run, const TreeScratch& scratch) {
    return {scratch.leaf_slot,   scratch.leaf_count,
            run.out.parent_slot, run.options.max_leaf > 1 ? scratch.kept : nullptr,
            scratch.meeting,     run.key_count,
            run.out.inner_count};
}

/// Throws InputError for builders that do not run as launches.
template <class Launcher, class Key, class LeafBox>
void launch_hierarchy(Launcher& plain, const TreeRun<Key>& run, const TreeScratch& scratch,
                      Arena& arena, const LeafBox& leaf_box) {
    const std::uint32_t n = run.capacity;
    const auto max_leaf = static_cast<std::uint32_t>(run.options.max_leaf);
    const LbvhInput<Key> in{run.keys, n, max_leaf};
    plain.launch("keys.counts", 1, SetKeyCounts{run.key_count, n, scratch.key_counts});
    CountedKeys<Launcher> launcher(plain, n, scratch.key_counts);
    switch (run.options.builder) {
        case Builder::karras:
            if (climbs_in_warps(run.options) && n > max_leaf)
                launch_karras_slots(plain, in, scratch.key_counts, parent_slots(run, scratch),
                                    scratch.kept, run.out.inner_count);
            else
                launch_karras(launcher, in, KarrasScratch(arena, n), run.out);
            break;
        case Builder::lauterbach: {
            // No wider for small n, which would have room for more: scratch for n serves fewer,
            // too.
            const std::uint32_t width = std::min(
                lauterbach_band_width(n, scratch.levels.limit, lauterbach_memory_limit(n)), 5u);
            launch_lauterbach(launcher, in,
                              LauterbachScratch(arena, n, scratch.levels.limit, width), run.out,
                              scratch.levels);
            break;
        }
        case Builder::garanzha:
            launch_garanzha(launcher, in, GaranzhaScratch(arena, n, max_leaf, scratch.levels.limit),
                            run.out, scratch.levels);
            break;
        case Builder::apetrei: {
            const ApetreiScratch mine(arena, n, max_leaf);
            if (fits_while_building(run.options))
                launch_apetrei(launcher, in, mine, leaf_box, run.out, run.max_depth);
            else
                launch_apetrei(launcher, in, mine, NoLeafBox{}, run.out, run.max_depth);
            break;
        }
        default:
            throw InputError("builder " + std::string(builder_name(run.options.builder)) +
                             " does not run on a device");
    }
    plain.launch("tree.few_keys", 1, LinkFewKeys{run.key_count, max_leaf, run.out});
}

/// Boxes of all nodes and the exact depth.
template <class Launcher, class Key, class LeafBox>
void launch_fit(Launcher& launcher, const TreeRun<Key>& run, const TreeScratch& scratch,
                const LeafBox& leaf_box) {
    BvhNode* nodes = run.out.nodes;
    const std::uint32_t limit =
        inner_node_limit(run.capacity, static_cast<std::uint32_t>(run.options.max_leaf));
    launcher.launch("fit.only_leaf", 1,
                    FitIfOnlyLeaf<LeafBox>{
                        {leaf_box, nodes, run.max_depth}, run.key_count, run.out.inner_count});
    if (limit == 0 || fits_while_building(run.options)) return;
    if (climbs_in_warps(run.options)) {
        launcher.launch_warps(
            "fit.climb", run.key_count, run.capacity,
            ClimbWarps<LeafBox>{leaf_box, parent_slots(run, scratch), nodes, run.max_depth});
        return;
    }
    if (fits_by_levels(run.options)) {
        const Builder builder = run.options.builder;
        TreeLevels levels = scratch.levels;
        if (builder != Builder::lauterbach && builder != Builder::garanzha)
            levels = launch_find_levels(launcher, nodes, limit, scratch.ranks, levels);
        launch_fit_levels(launcher, leaf_box, nodes, run.out.parent_slot, limit, levels,
                          scratch.by_levels, run.max_depth);
        return;
    }
    launch_fit_atomic(launcher, leaf_box, nodes, run.out.parent_slot, run.out.inner_count, limit,
                      scratch.meeting, run.max_depth);
}

}  // namespace raydix
