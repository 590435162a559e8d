// Kernels in which lanes whose rays are done take new ones while the others go on: replacement of
// terminated rays (Aila and Laine 2009, section 4) and dynamic fetch (their addendum of 2012).
#pragma once

#include <cstdint>

#include "base/bits.h"
#include "base/hd.h"
#include "simt/op.h"
#include "trace/warp/batches.h"
#include "trace/warp/lane.h"
#include "trace/warp/per_ray.h"
#include "trace/warp/steps.h"

namespace raydix {

/// Bits of `mask` below lane `lane`.
template <class Mask>
RAYDIX_HD static inline std::uint32_t rank_in(Mask mask, std::uint32_t lane) {
    return static_cast<std::uint32_t>(count_ones(mask & lanes_below<Mask>(lane)));
}

/// Stores the hits of finished lanes and gives them new rays: one atomic addition for the warp,
/// ranks by masked counts. Returns false once no lane has a ray. `dry`: the pool is empty.
template <class Warp>
RAYDIX_HD bool replace_finished(Warp& warp, const RayLaunch& launch, bool& dry) {
    const auto finished = warp.ballot(Op::ballot, is_finished);
    if (finished == 0) return true;
    warp.when([](const Lane& l) { return is_finished(l) && has_ray(l); },
              [&] { store_hits(warp, launch); });
    const auto count = static_cast<std::uint32_t>(count_ones(finished));
    if (dry) return count < Warp::width();
    const std::uint32_t first = warp.take(Op::take_rays, *launch.next, count);
    dry = first >= launch.count || launch.count - first <= count;
    if (first >= launch.count) return count < Warp::width();
    warp.when(is_finished, [&] {
        warp.step_indexed(Op::rank, [&](Lane& l, std::uint32_t lane) {
            l.ray = first + rank_in(finished, lane);
        });
        warp.step(Op::start_ray, [&](Lane& l) { start_ray(l, launch, l.ray); });
        touch_rays(warp, launch);
    });
    return true;
}

/// While-while in which terminated rays are replaced at every turn of the outer loop.
struct RayReplacement {
    static constexpr bool persistent = true, keeps_rays = true, one_stack = false;
    static constexpr int rays_per_lane = 1;
    bool dry = false;

    template <bool any_hit, class Warp>
    RAYDIX_HD bool turn(Warp& warp, const WarpJob& job, std::uint32_t) {
        if (!replace_finished(warp, job.launch, dry)) return false;
        WhileWhile::turn<any_hit>(warp, job.scene);
        return true;
    }
};

/// Speculative while-while that fetches when fewer than 20 of 32 lanes are at work.
struct DynamicFetch {
    static constexpr bool persistent = true, keeps_rays = true, one_stack = false;
    static constexpr int rays_per_lane = 1;
    bool dry = false;

    template <class Warp>
    [[nodiscard]] RAYDIX_HD static constexpr std::uint32_t least_active() {
        return (20 * Warp::width() + 31) / 32;
    }

    template <bool any_hit, class Warp>
    RAYDIX_HD bool turn(Warp& warp, const WarpJob& job, std::uint32_t) {
        if (!replace_finished(warp, job.launch, dry)) return false;
        warp.voting_loop(
            Op::main_loop, is_unfinished,
            [&] { SpeculativeWhileWhile::turn<any_hit>(warp, job.scene); },
            [&] {
                if (dry) return true;  // nothing to fetch
                const auto active = warp.ballot(Op::ballot, is_unfinished);
                return static_cast<std::uint32_t>(count_ones(active)) >= least_active<Warp>();
            });
        return true;
    }
};

}  // namespace raydix
