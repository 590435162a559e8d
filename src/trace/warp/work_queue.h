// Local work queues (Aila and Laine 2009, section 4): twice as many rays as lanes, the spare ones
// in shared memory. Lanes exchange rays, so that as many of them as possible want the same
// operation, and again when too few do.
#pragma once

#include <cstdint>

#include "base/bits.h"
#include "base/hd.h"
#include "simt/op.h"
#include "simt/thread_warp.h"
#include "trace/warp/batches.h"
#include "trace/warp/lane.h"
#include "trace/warp/per_ray.h"
#include "trace/warp/replacement.h"
#include "trace/warp/steps.h"

namespace raydix {

/// What a ray needs next. Rays are few enough that the three are counted, and the most wanted wins.
enum class Want : std::uint32_t { node, triangle, fetch };

RAYDIX_HD static inline bool wants(const Lane& l, Want want) {
    return want == Want::node       ? at_inner_node(l)
           : want == Want::triangle ? at_leaf(l)
                                    : is_finished(l);
}

class WorkQueue {
public:
    static constexpr bool persistent = true, keeps_rays = true, one_stack = false;
    static constexpr int rays_per_lane = 2;

    template <bool any_hit, class Warp>
    RAYDIX_HD bool turn(Warp& warp, const WarpJob& job, std::uint32_t) {
        if (wanted_ == Want::fetch) fetch(warp, job.launch);
        // To the next fetch, which opens the next turn.
        warp.uniform_loop(
            Op::main_loop, [&] { return choose(warp) && wanted_ != Want::fetch; },
            [&] {
                gather(warp);
                repeat<any_hit>(warp, job.scene);
            });
        if (!none_left_) gather(warp);
        return !none_left_;
    }

private:
    /// Lanes with finished rays store their hits and take new ones.
    template <class Warp>
    RAYDIX_HD void fetch(Warp& warp, const RayLaunch& launch) {
        const auto finished = warp.ballot(Op::ballot, is_finished);
        warp.when([](const Lane& l) { return is_finished(l) && has_ray(l); },
                  [&] { store_hits(warp, launch); });
        if (dry_) return;
        const auto count = static_cast<std::uint32_t>(count_ones(finished));
        const std::uint32_t first = warp.take(Op::take_rays, *launch.next, count);
        dry_ = first >= launch.count || launch.count - first <= count;
        if (first >= launch.count) return;
        warp.when(is_finished, [&] {
            warp.step_indexed(Op::rank, [&](Lane& l, std::uint32_t lane) {
                l.ray = first + rank_in(finished, lane);
            });
            warp.step(Op::start_ray, [&](Lane& l) { start_ray(l, launch, l.ray); });
            touch_rays(warp, launch);
        });
    }

    /// Sets what most rays of lanes and spares want; false if no ray wants anything. Fetching is
    /// wanted by a full warp only, unless nothing else is. A finished ray still to be stored counts
    /// as a wish to fetch, also when the pool is dry.
    template <class Warp>
    RAYDIX_HD bool choose(Warp& warp) {
        const int nodes = count(warp, [](const Lane& l) { return at_inner_node(l); });
        const int triangles = count(warp, [](const Lane& l) { return at_leaf(l); });
        const bool dry = dry_;
        const int done =
            count(warp, [dry](const Lane& l) { return is_finished(l) && (!dry || has_ray(l)); });
        return warp.uniform(Op::choose, [&] {
            const bool idle = nodes + triangles == 0;
            none_left_ = idle && done == 0;
            wanted_ = (idle && done > 0) || done >= static_cast<int>(Warp::width()) ? Want::fetch
                      : triangles > nodes                                           ? Want::triangle
                                                                                    : Want::node;
            return !none_left_;
        });
    }
    template <class Warp, class Cond>
    RAYDIX_HD static int count(Warp& warp, Cond cond) {
        const auto own = warp.ballot(Op::ballot, cond);
        const auto spare = warp.ballot_indexed(Op::ballot, [&](const Lane&, std::uint32_t lane) {
            return cond(warp.memory.spares[lane]);
        });
        return count_ones(own) + count_ones(spare);
    }

    /// Lanes that do not want the operation exchange their rays for spare ones that do: the k-th of
    /// the former takes the k-th of the latter, whose places go through shared memory.
    template <class Warp>
    RAYDIX_HD void gather(Warp& warp) {
        const Want wanted = wanted_;
        const bool dry = dry_;
        // Of finished rays, those with a hit to store count when there is nothing to fetch.
        const auto fits = [wanted, dry](const Lane& l) {
            return wants(l, wanted) && (wanted != Want::fetch || !dry || has_ray(l));
        };
        const auto without = warp.ballot(Op::ballot, [&](const Lane& l) { return !fits(l); });
        const auto offered = warp.ballot_indexed(Op::ballot, [&](const Lane&, std::uint32_t lane) {
            return fits(warp.memory.spares[lane]);
        });
        if (without == 0 || offered == 0) return;
        const auto pairs =
            static_cast<std::uint32_t>(lesser_count(count_ones(without), count_ones(offered)));
        warp.among(offered, [&] {
            warp.step_indexed(Op::rank, [&](const Lane&, std::uint32_t lane) {
                warp.memory.slots[rank_in(offered, lane)] = lane;
            });
        });
        const auto served =
            without & warp.ballot_indexed(Op::rank, [&](const Lane&, std::uint32_t lane) {
                return rank_in(without, lane) < pairs;
            });
        warp.among(served, [&] {
            warp.step_indexed(Op::exchange_ray, [&](Lane& l, std::uint32_t lane) {
                Lane& spare = warp.memory.spares[warp.memory.slots[rank_in(without, lane)]];
                const Lane mine = l;
                l = spare;
                spare = mine;
            });
        });
    }
    /// Lanes below which it pays to exchange rays again: three quarters of the warp.
    template <class Warp>
    [[nodiscard]] RAYDIX_HD static constexpr int enough_lanes() {
        return static_cast<int>((3 * Warp::width() + 3) / 4);
    }
    /// The operation once, and again as long as enough lanes go on wanting it.
    template <bool any_hit, class Warp>
    RAYDIX_HD void repeat(Warp& warp, const WarpScene& scene) {
        const Want wanted = wanted_;
        const auto same = [wanted](const Lane& l) { return wants(l, wanted); };
        bool once = false;
        warp.uniform_loop(
            wanted == Want::node ? Op::node_loop : Op::leaf_loop,
            [&] {
                const bool again = once;
                once = true;
                return !again || count_ones(warp.ballot(Op::ballot, same)) >= enough_lanes<Warp>();
            },
            [&] {
                warp.when(same, [&] {
                    if (wanted == Want::node)
                        visit_once(warp, scene);
                    else
                        test_in_place<any_hit>(warp, scene);
                });
            });
    }
    RAYDIX_HD static int lesser_count(int a, int b) { return a < b ? a : b; }

    Want wanted_ = Want::fetch;
    bool dry_ = false, none_left_ = false;
};

}  // namespace raydix
