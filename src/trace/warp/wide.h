// While-while over a compressed wide tree (Ylitie, Karras, Laine 2017, section 3.3), beside the
// family of Aila and Laine: lanes visit nodes of eight children until each has triangles to test.
// Triangles are Woop's, as those of the family.
#pragma once

#include <cmath>
#include <cstdint>

#include "base/hd.h"
#include "simt/op.h"
#include "simt/thread_warp.h"
#include "trace/cwbvh_node.h"
#include "trace/warp/lane.h"
#include "trace/warp/per_ray.h"
#include "trace/warp/steps.h"

namespace raydix {

/// Lane::node is a wide node, or the complement of a triangle's position.
struct WideLane : Lane {
    CwbvhGroup group;         // children of one node that are still to visit
    std::uint32_t first;      // triangle_base of the node whose triangles are tested
    std::uint32_t triangles;  // of which those are left, by bits
    std::uint32_t octant;
    Vec3 margin;  // by which the times of planes move, near ones back, far ones on
};

RAYDIX_HD static inline bool has_no_group(const WideLane& l) { return !l.group.has_nodes(); }
RAYDIX_HD static inline bool has_group(const WideLane& l) { return l.group.has_nodes(); }

/// `node` to the next of the triangles that were met; popped_node if none is left.
RAYDIX_HD static inline void next_of_leaf(WideLane& l) {
    const bool none = l.triangles == 0;
    const auto bit = static_cast<std::uint32_t>(highest_bit(l.triangles));
    l.node = none ? popped_node : static_cast<std::int32_t>(~(l.first + bit));
    l.triangles = none ? 0u : l.triangles ^ 1u << (bit & 31u);
}

/// Boxes grow by the pad of cwbvh_walk.h, on all axes that of the farthest side of the root, for
/// the roundings of their planes; and by as much as those of pair64, since Woop's triangles err
/// with the size of coordinates. Larger ones would let in hits that the other kernels never meet.
RAYDIX_HD static inline void start_wide(WideLane& l, const WarpScene& scene) {
    const Aabb& root = scene.wide.bounds;
    const auto reach = [](float lo, float hi, float o) {
        return greater(std::fabs(lo - o), std::fabs(hi - o));
    };
    const float farthest = greater(
        greater(reach(root.lo.x, root.hi.x, l.origin.x), reach(root.lo.y, root.hi.y, l.origin.y)),
        reach(root.lo.z, root.hi.z, l.origin.z));
    const float pad =
        cwbvh_pad_factor * (2 * slab_pad * farthest + least_slab_pad) + scene.wide.padding;
    l.margin = {pad * std::fabs(l.inverse.x), pad * std::fabs(l.inverse.y),
                pad * std::fabs(l.inverse.z)};
    l.group = {0, 0};
    l.first = 0;
    l.triangles = 0;
    l.octant =
        octant_of(std::signbit(l.inverse.x), std::signbit(l.inverse.y), std::signbit(l.inverse.z));
}

/// Boxes of all children are tested. Those that the ray meets become its group and its triangles.
RAYDIX_HD static inline void visit_wide(WideLane& l, const WarpScene& scene) {
    const CwbvhWords words = load_node(scene.wide.nodes + l.node);
    const auto axis = [&](int k, float origin, float inverse, float margin) {
        const float start = (float_of_bits(words.word[k]) - origin) * inverse;
        return CwbvhAxis{float_of_bits(byte_of(words.word[3], k) << 23) * inverse, start - margin,
                         start + margin};
    };
    const CwbvhAxis axes[3] = {axis(0, l.origin.x, l.inverse.x, l.margin.x),
                               axis(1, l.origin.y, l.inverse.y, l.margin.y),
                               axis(2, l.origin.z, l.inverse.z, l.margin.z)};
    const std::uint32_t hits = meet_children(
        l.octant, words, axes, l.tmin, l.t,
        [](float steps, float rate, float start) { return multiply_add(steps, rate, start); });
    l.group = met_nodes(words, hits);
    l.first = words.word[5];
    l.triangles = met_triangles(hits);
    next_of_leaf(l);
}

RAYDIX_HD static inline void take_child(WideLane& l) {
    l.node = static_cast<std::int32_t>(take_first_child(l.octant, l.group));
}
RAYDIX_HD static inline void push_group(WideLane& l) {
    l.stack[2 * l.top] = static_cast<std::int32_t>(l.group.base);
    l.stack[2 * l.top + 1] = static_cast<std::int32_t>(l.group.hits);
    ++l.top;
}
RAYDIX_HD static inline void pop_group(WideLane& l) {
    const bool empty = l.top == 0;
    l.top -= empty ? 0 : 1;
    l.node = empty ? finished_node : popped_node;
    if (empty) return;
    l.group = {static_cast<std::uint32_t>(l.stack[2 * l.top]),
               static_cast<std::uint32_t>(l.stack[2 * l.top + 1])};
}

struct WideWhileWhile {
    static constexpr bool one_stack = false;
    using LaneType = WideLane;

    template <bool any_hit, class Warp>
    RAYDIX_HD static void trace(Warp& warp, const WarpScene& scene) {
        const WarpScene leaves{nullptr, scene.wide.triangles, scene.wide.ids};
        warp.step(Op::start_ray, [&](WideLane& l) { start_wide(l, scene); });
        warp.loop(Op::main_loop, is_unfinished, [&] {
            warp.loop(Op::node_loop, at_inner_node, [&] { visit_once(warp, scene); });
            warp.loop(Op::leaf_loop, at_leaf, [&] { test_once<any_hit>(warp, leaves); });
        });
    }

private:
    template <class Warp>
    RAYDIX_HD static void visit_once(Warp& warp, const WarpScene& scene) {
        warp.touches(
            Access::read, [&](const WideLane& l) { return scene.wide.nodes + l.node; },
            sizeof(CwbvhNode));
        warp.step(Op::visit_node, [&](WideLane& l) { visit_wide(l, scene); });
        go_on(warp);
    }
    template <bool any_hit, class Warp>
    RAYDIX_HD static void test_once(Warp& warp, const WarpScene& leaves) {
        test_triangle(warp, leaves, [](const Lane& l) { return l.node; });
        warp.touches(
            Access::read_beside,
            [&](const WideLane& l) {
                return plane_in_range(l) && inside_edges(l) ? leaves.ids + ~l.node : nullptr;
            },
            4);
        warp.step(Op::next_triangle, [](WideLane& l) {
            next_of_leaf(l);
            l.node = any_hit && l.prim != no_primitive ? finished_node : l.node;
        });
        go_on(warp);
    }
    /// To the first child of the group, whose others go to the stack. A group that has none left is
    /// replaced by the one on the stack.
    template <class Warp>
    RAYDIX_HD static void go_on(Warp& warp) {
        warp.when(must_pop, [&] {
            warp.when(has_no_group, [&] {
                touch_group(warp, Access::read, -2);
                warp.step(Op::pop, [](WideLane& l) { pop_group(l); });
            });
            warp.when(must_pop, [&] {
                warp.step(Op::choose, [](WideLane& l) { take_child(l); });
                warp.when(has_group, [&] {
                    touch_group(warp, Access::write, 0);
                    warp.step(Op::push, [](WideLane& l) { push_group(l); });
                });
            });
        });
    }
    template <class Warp>
    RAYDIX_HD static void touch_group(Warp& warp, Access how, std::int32_t from_top) {
        for (std::int32_t word = 0; word < 2; ++word)
            warp.touches_stack(how, [=](const WideLane& l) {
                return 2 * static_cast<std::int32_t>(l.top) + from_top + word;
            });
    }
};

}  // namespace raydix
