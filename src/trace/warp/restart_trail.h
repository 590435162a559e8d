// While-while with a short stack (Laine 2010, "Restart trail for stackless BVH traversal"), beside
// the family of Aila and Laine. The stack keeps the last few nodes that were put aside, in
// registers; a lane that needs one it no longer has begins at the root again. Its trail, a bit for
// each level, leads it to where it has not been. Without entries there is no stack at all.
#pragma once

#include <cstdint>

#include "base/hd.h"
#include "simt/op.h"
#include "simt/thread_warp.h"
#include "trace/warp/lane.h"
#include "trace/warp/pair_visit.h"
#include "trace/warp/per_ray.h"
#include "trace/warp/steps.h"

// Intel's OpenCL driver for processors (2026.2) stores no hit but that of lane 0 where it sees all
// of this kernel in one function.
#if defined(__SPIRV__)
#define RAYDIX_TRAIL_CALL [[gnu::noinline]] RAYDIX_HD
#else
#define RAYDIX_TRAIL_CALL RAYDIX_HD
#endif

namespace raydix {

/// A level is its bit: the highest one at the root, the next lower one at its children.
template <int entries>
struct TrailLane : Lane {
    static_assert(entries % 2 == 0);
    static constexpr bool stack_in_registers = true;
    std::uint64_t trail;  // levels where nothing is left but the child that the lane goes to
    std::uint64_t level;  // of `node`
    std::uint64_t begun;  // the lowest level where the nearer child is done and the farther is not
    std::uint64_t recent[entries > 0 ? entries / 2 : 1];  // two nodes in each, the last first

    RAYDIX_HD void start() {
        trail = begun = 0;
        level = root_level;
    }
    static constexpr std::uint64_t root_level = std::uint64_t{1} << 63;  // trail_levels - 1
};

template <int entries>
struct RestartTrail {
    static constexpr bool one_stack = false;
    using LaneType = TrailLane<entries>;

    template <bool any_hit, class Warp>
    RAYDIX_HD static void trace(Warp& warp, const WarpScene& scene) {
        warp.loop(Op::main_loop, is_unfinished, [&] {
            warp.loop(Op::node_loop, at_inner_node, [&] { visit_once(warp, scene); });
            warp.loop(Op::leaf_loop, at_leaf,
                      [&] { test_in_place<any_hit>(warp, scene, [&] { go_on(warp); }); });
        });
    }

private:
    template <class Warp>
    RAYDIX_HD static void visit_once(Warp& warp, const WarpScene& scene) {
        warp.touches(
            Access::read, [&](const Lane& l) { return &scene.pairs[l.node]; }, sizeof(NodePair));
        warp.step_then(
            Op::visit_node, [&](LaneType& l) { visit(l, scene); },
            [](const Lane& l) { return entries > 0 && must_push(l); },
            [&] { warp.step(Op::push, [](LaneType& l) { keep(l); }); }, must_pop,
            [&] { go_on(warp); });
    }
    template <class Warp>
    RAYDIX_TRAIL_CALL static void go_on(Warp& warp) {
        warp.step(Op::pop, [](LaneType& l) { next_in_trail(l); });
    }
    /// Where both children are met the nearer one comes first, and the farther one when the trail
    /// says that the nearer is done. If only one is met where the farther is left, that is the
    /// nearer: its hits lie before the farther one. (Above that level the nearer may be walked
    /// again, where the roundings of a box far away take the farther one out of reach.)
    RAYDIX_HD static void visit(LaneType& l, const WarpScene& scene) {
        const NodePair n = scene.pairs[l.node];
        const PairVisit met = meet_pair(l, n);
        const bool both = met.first & met.second, one = met.first != met.second;
        const bool nearer_is_done = (l.trail & l.level) != 0;
        const bool goes_on = both | (one & (l.level != l.begun));
        const bool to_second = both ? met.second_is_closer != nearer_is_done : met.second;
        const std::int32_t other = to_second ? n.child0 : n.child1;
        l.node = goes_on ? (to_second ? n.child1 : n.child0) : popped_node;
        l.aside = (both & !nearer_is_done) ? other : finished_node;
        l.trail |= (goes_on & !both) ? l.level : 0;
        l.level >>= goes_on ? 1 : 0;
    }
    RAYDIX_HD static void keep(LaneType& l) {
        std::uint64_t in = static_cast<std::uint32_t>(l.aside);
        for (std::uint64_t& two : l.recent) {
            const std::uint64_t out = two >> 32;
            two = two << 32 | in;
            in = out;
        }
        l.top += l.top < entries ? 1 : 0;
    }
    /// The lowest level above that has a child left gets its bit, and those below it lose theirs.
    /// Above the root is none.
    RAYDIX_HD static void next_in_trail(LaneType& l) {
        const std::uint64_t above = l.level << 1, upper = ~above + 1;  // the levels from `above` up
        l.trail = (l.trail & upper) + above;
        l.begun = l.trail & (~l.trail + 1);
        const bool kept = l.top > 0;
        l.node = l.trail == 0 ? finished_node
                 : kept       ? static_cast<std::int32_t>(l.recent[0] & 0xFFFFFFFFu)
                              : 0;
        l.level = kept ? l.begun >> 1 : LaneType::root_level;
        for (int k = 0; k < entries / 2; ++k) {
            const std::uint64_t in = k + 1 < entries / 2 ? l.recent[k + 1] << 32 : 0;
            l.recent[k] = l.recent[k] >> 32 | in;
        }
        l.top -= kept ? 1 : 0;
    }
};

/// Four entries: what is still begun again costs little (docs/algorithms/warp-kernels.md).
using ShortStack = RestartTrail<4>;

#undef RAYDIX_TRAIL_CALL

}  // namespace raydix
