// Packet traversal as the 2009 comparison has it: one stack a warp, in shared memory; all rays
// follow the union of the nodes that any of them needs, and the majority decides the order.
#pragma once

#include <cstdint>

#include "base/bits.h"
#include "base/hd.h"
#include "simt/op.h"
#include "simt/thread_warp.h"
#include "trace/warp/lane.h"
#include "trace/warp/per_ray.h"
#include "trace/warp/steps.h"

namespace raydix {

/// The body for trace/warp/batches.h. What is said of the packet is the same in all lanes; a lane
/// takes part in a node if it met the node's box.
struct Packet {
    static constexpr bool one_stack = true;

    template <bool any_hit, class Warp>
    RAYDIX_HD static void trace(Warp& warp, const WarpScene& scene) {
        PacketEntry at{0, warp.ballot(Op::vote, is_unfinished)};
        LaneMask alive = at.lanes;
        std::uint32_t top = 0;
        warp.uniform_loop(
            Op::main_loop, [&] { return at.lanes != 0; },
            [&] {
                if (at.node >= 0) {
                    at = visit(warp, scene, at, top);
                } else {
                    alive = test_leaf<any_hit>(warp, scene, at, alive);
                    at.lanes = 0;
                }
                while (at.lanes == 0 && top > 0) {
                    at = warp.uniform(Op::pop, [&] { return warp.memory.packets[top - 1]; });
                    at.lanes &= alive;
                    --top;
                }
            });
        warp.step(Op::choose, [](Lane& l) { l.node = finished_node; });
    }

private:
    /// Both children against the packet. No lanes come back if it must pop.
    template <class Warp>
    RAYDIX_HD static PacketEntry visit(Warp& warp, const WarpScene& scene, PacketEntry at,
                                       std::uint32_t& top) {
        const NodePair& pair = scene.pairs[at.node];
        warp.among(at.lanes, [&] {
            warp.touches(
                Access::read, [&](const Lane&) { return &pair; }, sizeof(NodePair));
            warp.step(Op::visit_node, [&](Lane& l) {
                const PairVisit met = meet_pair(l, pair);
                const bool rather_second = met.second && (met.second_is_closer || !met.first);
                l.meets =
                    (met.first ? 1u : 0u) | (met.second ? 2u : 0u) | (rather_second ? 4u : 0u);
            });
        });
        const auto votes = [&](std::uint32_t flag, Op op = Op::vote) {
            return at.lanes &
                   warp.ballot(op, [flag](const Lane& l) { return (l.meets & flag) != 0; });
        };
        const PacketEntry first{pair.child0, votes(1)}, second{pair.child1, votes(2)};
        if (first.lanes == 0 || second.lanes == 0) return first.lanes == 0 ? second : first;
        const LaneMask rather_second = votes(4, Op::ballot);
        const bool to_second = warp.uniform(Op::choose, [&] {
            return 2 * count_ones(rather_second) > count_ones(first.lanes | second.lanes);
        });
        warp.write_shared(Op::push, [&] { warp.memory.packets[top] = to_second ? first : second; });
        ++top;
        return to_second ? second : first;
    }

    /// All triangles of the leaf. Returns the lanes that still search.
    template <bool any_hit, class Warp>
    RAYDIX_HD static LaneMask test_leaf(Warp& warp, const WarpScene& scene, PacketEntry at,
                                        LaneMask alive) {
        std::int32_t link = at.node;
        warp.uniform_loop(
            Op::leaf_loop, [&] { return link != 0; },
            [&] {
                warp.among(at.lanes, [&] {
                    test_triangle(warp, scene, [link](const Lane&) { return link; });
                });
                link =
                    warp.uniform(Op::next_triangle, [&] { return after_triangle(link, scene, 0); });
            });
        if (!any_hit) return alive;
        return alive & warp.ballot(Op::vote, [](const Lane& l) { return l.prim == no_primitive; });
    }
};

}  // namespace raydix
