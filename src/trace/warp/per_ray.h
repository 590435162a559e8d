// Aila and Laine 2009: while-while, if-if and speculative while-while. Each is a body that takes a
// warp of started rays to their ends; trace/warp/batches.h says where rays come from.
#pragma once

#include <cstdint>

#include "base/hd.h"
#include "simt/op.h"
#include "simt/thread_warp.h"
#include "trace/warp/lane.h"
#include "trace/warp/steps.h"

namespace raydix {

RAYDIX_HD static inline std::int32_t top_of(const Lane& l) {
    return static_cast<std::int32_t>(l.top);
}

template <class Warp>
RAYDIX_HD void pop_next(Warp& warp) {
    warp.touches_stack(Access::read, [](const Lane& l) { return top_of(l) - 1; });
    warp.step(Op::pop, [](Lane& l) { pop(l); });
}

/// One visit of an inner node.
template <class Warp>
RAYDIX_HD void visit_once(Warp& warp, const WarpScene& scene) {
    warp.touches(
        Access::read, [&](const Lane& l) { return &scene.pairs[l.node]; }, sizeof(NodePair));
    warp.step_then(
        Op::visit_node, [&](Lane& l) { visit_node(l, scene); },
        [](const Lane& l) { return must_push(l); },
        [&] {
            warp.touches_stack(Access::write, top_of);
            warp.step(Op::push, [](Lane& l) { push(l); });
        },
        [](const Lane& l) { return must_pop(l); }, [&] { pop_next(warp); });
}

/// Tests the triangle at `link(lane)`, a reference to a leaf link.
template <class Warp, class Link>
RAYDIX_HD void test_triangle(Warp& warp, const WarpScene& scene, Link link) {
    const auto position = [link](const Lane& l) { return static_cast<std::uint32_t>(~link(l)); };
    warp.touches(
        Access::read, [&](const Lane& l) { return scene.triangles[position(l)].z; }, 16);
    warp.step(Op::test_triangle, [&](Lane& l) { test_plane(l, scene, position(l)); });
    warp.when([](const Lane& l) { return plane_in_range(l); },
              [&] {
                  warp.touches(
                      Access::read, [&](const Lane& l) { return scene.triangles[position(l)].x; },
                      32);
                  warp.step(Op::test_edges, [&](Lane& l) { test_edges(l, scene, position(l)); });
                  warp.when([](const Lane& l) { return inside_edges(l); },
                            [&] {
                                warp.step(Op::accept_hit,
                                          [&](Lane& l) { accept_hit(l, scene, position(l)); });
                            });
              });
}

/// The triangle that `node` stands at, and on to the next or out of the leaf: `go_on` gives lanes
/// that are done with it their next node.
template <bool any_hit, class Warp, class GoOn>
RAYDIX_HD void test_in_place(Warp& warp, const WarpScene& scene, const GoOn& go_on) {
    test_triangle(warp, scene, [](const Lane& l) { return l.node; });
    warp.touches(
        Access::read_beside, [&](const Lane& l) { return &scene.ids[~l.node]; }, 4);
    warp.step(Op::next_triangle, [&](Lane& l) {
        const std::int32_t next = after_triangle(l.node, scene, popped_node);
        l.node = any_hit && l.prim != no_primitive ? finished_node : next;
    });
    warp.when(must_pop, go_on);
}
template <bool any_hit, class Warp>
RAYDIX_HD void test_in_place(Warp& warp, const WarpScene& scene) {
    test_in_place<any_hit>(warp, scene, [&] { pop_next(warp); });
}

/// Nodes until each lane has come to a leaf, then all triangles of those leaves.
struct WhileWhile {
    static constexpr bool one_stack = false;

    template <bool any_hit, class Warp>
    RAYDIX_HD static void trace(Warp& warp, const WarpScene& scene) {
        warp.loop(Op::main_loop, is_unfinished, [&] { turn<any_hit>(warp, scene); });
    }
    /// One turn of the outer loop.
    template <bool any_hit, class Warp>
    RAYDIX_HD static void turn(Warp& warp, const WarpScene& scene) {
        warp.loop(Op::node_loop, at_inner_node, [&] { visit_once(warp, scene); });
        warp.loop(Op::leaf_loop, at_leaf, [&] { test_in_place<any_hit>(warp, scene); });
    }
};

/// A node or a triangle a turn.
struct IfIf {
    static constexpr bool one_stack = false;

    template <bool any_hit, class Warp>
    RAYDIX_HD static void trace(Warp& warp, const WarpScene& scene) {
        warp.loop(Op::main_loop, is_unfinished, [&] {
            warp.when(at_inner_node, [&] { visit_once(warp, scene); });
            warp.when(at_leaf, [&] { test_in_place<any_hit>(warp, scene); });
        });
    }
};

/// As while-while, but a lane that found a leaf puts it aside and walks on, until every lane of the
/// warp has one: its further visits cost nothing while others search.
struct SpeculativeWhileWhile {
    static constexpr bool one_stack = false;

    template <bool any_hit, class Warp>
    RAYDIX_HD static void trace(Warp& warp, const WarpScene& scene) {
        warp.voting_loop(
            Op::main_loop, is_unfinished, [&] { turn<any_hit>(warp, scene); }, [] { return true; });
    }
    template <bool any_hit, class Warp>
    RAYDIX_HD static void turn(Warp& warp, const WarpScene& scene) {
        warp.voting_loop(
            Op::node_loop, at_inner_node,
            [&] {
                visit_once(warp, scene);
                warp.when(found_first_leaf, [&] { put_leaf_aside(warp); });
            },
            [&] { return warp.any(Op::vote, still_searching); });
        warp.loop(Op::leaf_loop, has_leaf_aside, [&] { test_leaf_aside<any_hit>(warp, scene); });
    }

private:
    RAYDIX_HD static bool found_first_leaf(const Lane& l) { return at_leaf(l) && l.leaf == 0; }
    RAYDIX_HD static bool still_searching(const Lane& l) { return at_inner_node(l) && l.leaf == 0; }
    template <class Warp>
    RAYDIX_HD static void put_leaf_aside(Warp& warp) {
        warp.step(Op::postpone_leaf, [](Lane& l) { l.leaf = l.node; });
        pop_next(warp);
    }
    template <bool any_hit, class Warp>
    RAYDIX_HD static void test_leaf_aside(Warp& warp, const WarpScene& scene) {
        test_triangle(warp, scene, [](const Lane& l) { return l.leaf; });
        warp.touches(
            Access::read_beside, [&](const Lane& l) { return &scene.ids[~l.leaf]; }, 4);
        warp.step(Op::next_triangle, [&](Lane& l) {
            const bool end = any_hit && l.prim != no_primitive;
            l.leaf = end ? 0 : after_triangle(l.leaf, scene, 0);
            l.node = end ? finished_node : l.node;
        });
        // The walk may have stopped at a second leaf.
        warp.when([](const Lane& l) { return l.leaf == 0 && at_leaf(l); },
                  [&] {
                      warp.step(Op::next_leaf, [](Lane& l) { l.leaf = l.node; });
                      pop_next(warp);
                  });
    }
};

}  // namespace raydix
