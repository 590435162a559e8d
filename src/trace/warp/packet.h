// Packet traversal as the 2009 comparison has it, after Guenther et al. 2007: one stack of nodes a
// warp, in shared memory; all rays visit the union of the nodes that any of them needs, and the
// majority decides the order.
#pragma once

#include <cstdint>

#include "base/bits.h"
#include "base/hd.h"
#include "simt/op.h"
#include "simt/thread_warp.h"
#include "trace/warp/lane.h"
#include "trace/warp/packet_lanes.h"
#include "trace/warp/per_ray.h"
#include "trace/warp/steps.h"

namespace raydix {

/// The body for trace/warp/batches.h. What is said of the packet is the same in all lanes. All
/// lanes test each node and each triangle; one that searches no more has tmin > t, so that it meets
/// nothing.
struct Packet {
    static constexpr bool one_stack = true;

    template <bool any_hit, class Warp>
    RAYDIX_HD static void trace(Warp& warp, const WarpScene& scene) {
        warp.step(Op::choose, [](Lane& l) {
            if (is_finished(l)) l.tmin = infinity, l.t = -infinity;
        });
        PacketLanes<Warp> lanes(warp);
        std::int32_t at = 0;
        std::uint32_t top = 0;
        warp.uniform_loop(
            Op::main_loop, [&] { return at != finished_node; },
            [&] {
                if (at >= 0) {
                    at = visit(warp, lanes, scene, at, top);
                } else {
                    at = test_leaf<any_hit>(warp, lanes, scene, at);
                }
                if (at == popped_node && top == 0) {
                    at = finished_node;
                } else if (at == popped_node) {
                    at = warp.uniform(Op::pop, [&] { return warp.memory.packet_stack[--top]; });
                }
            });
    }

private:
    /// Both children against the packet. Returns where it goes next.
    template <class Warp>
    RAYDIX_HD static std::int32_t visit(Warp& warp, PacketLanes<Warp>& lanes,
                                        const WarpScene& scene, std::int32_t node,
                                        std::uint32_t& top) {
        warp.touches(
            Access::read, [&](const Lane&) { return scene.pairs + node; }, sizeof(NodePair));
        NodePair pair{};  // loaded once, links too
        lanes.meet(warp, Op::visit_node, scene.pairs + node, pair);
        const auto first = lanes.first(warp, Op::vote);
        const auto second = lanes.second(warp, Op::vote);
        if (first == 0) return second == 0 ? popped_node : pair.child1;
        if (second == 0) return pair.child0;
        const auto rather_second = lanes.rather_second(warp, Op::ballot);
        const bool to_second = warp.uniform(
            Op::choose, [&] { return 2 * count_ones(rather_second) > count_ones(first | second); });
        warp.write_shared(Op::push, [&] {
            warp.memory.packet_stack[top] = to_second ? pair.child0 : pair.child1;
        });
        ++top;
        return to_second ? pair.child1 : pair.child0;
    }

    /// All triangles of the leaf. Returns popped_node, or finished_node if no lane searches any
    /// more.
    template <bool any_hit, class Warp>
    RAYDIX_HD static std::int32_t test_leaf(Warp& warp, PacketLanes<Warp>& lanes,
                                            const WarpScene& scene, std::int32_t link) {
        warp.uniform_loop(
            Op::leaf_loop, [&] { return link != 0; },
            [&] {
                if (!lanes.pass_by(warp, scene.triangles[~link])) {
                    test_triangle(warp, scene, [link](const Lane&) { return link; });
                    lanes.look_again(warp);
                }
                link =
                    warp.uniform(Op::next_triangle, [&] { return after_triangle(link, scene, 0); });
            });
        if (!any_hit) return popped_node;
        warp.step(Op::choose, [](Lane& l) { l.tmin = l.prim == no_primitive ? l.tmin : infinity; });
        lanes.look_again(warp);
        const bool searching = warp.any(Op::vote, [](const Lane& l) { return l.tmin <= l.t; });
        return searching ? popped_node : finished_node;
    }
};

}  // namespace raydix
