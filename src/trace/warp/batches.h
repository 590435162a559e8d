// Where the rays of a warp come from, for bodies that trace a whole batch: one batch a warp, or
// persistent warps that fetch batch after batch (Aila and Laine 2009, section 3.3).
//
// A kernel is a `turn`, repeated as long as it returns true. It fetches rays at the start of a turn
// and nowhere else, so that a simulator can put the fetches of many warps in order of time.
#pragma once

#include <cstdint>

#include "base/hd.h"
#include "simt/op.h"
#include "simt/thread_warp.h"
#include "trace/warp/lane.h"
#include "trace/warp/steps.h"

namespace raydix {

/// Kernels say of themselves:
/// - persistent: as many warps as fill the machine, which fetch from the pool until it is empty;
/// - keeps_rays: lanes have rays from one turn to the next;
/// - one_stack: the warp has a stack, its lanes have none;
/// - LaneType: what their lanes are, if it is more than Lane; its start() begins a ray, where that
///   needs nothing of the scene;
/// - rays_per_lane: 2 if half of the rays wait in shared memory.
///
/// What is the same for all warps of a launch.
struct WarpJob {
    WarpScene scene;
    RayLaunch launch;
};

/// Tells memory models that lanes read their new rays.
template <class Warp>
RAYDIX_HD void touch_rays(Warp& warp, const RayLaunch& launch) {
    warp.touches(
        Access::read, [&](const Lane& l) { return has_ray(l) ? launch.rays + l.ray : nullptr; },
        sizeof(Ray));
}

/// Results of the lanes that have one.
template <class Warp>
RAYDIX_HD void store_hits(Warp& warp, const RayLaunch& launch) {
    warp.touches(
        Access::write, [&](const Lane& l) { return has_ray(l) ? launch.hits + l.ray : nullptr; },
        sizeof(TreeHit));
    warp.step(Op::store_hit, [&](Lane& l) { store_hit(l, launch); });
}

template <class Warp>
RAYDIX_HD void start_batch(Warp& warp, const RayLaunch& launch, std::uint32_t first) {
    warp.step_indexed(Op::start_ray, [&](auto& l, std::uint32_t lane) {
        start_ray(l, launch, first + lane);
        if constexpr (requires { l.start(); }) l.start();
    });
    touch_rays(warp, launch);
}

/// Warp k traces rays [k * width, (k + 1) * width).
template <class Body>
struct OneBatch {
    static constexpr bool persistent = false, keeps_rays = false, one_stack = Body::one_stack;
    static constexpr int rays_per_lane = 1;
    using LaneType = typename LaneOf<Body>::Type;

    template <bool any_hit, class Warp>
    RAYDIX_HD bool turn(Warp& warp, const WarpJob& job, std::uint32_t warp_index) {
        start_batch(warp, job.launch, warp_index * Warp::width());
        Body::template trace<any_hit>(warp, job.scene);
        store_hits(warp, job.launch);
        return false;
    }
};

/// Batches a persistent warp takes from the pool at once: 96 rays at 32 lanes, as in the release.
inline constexpr std::uint32_t batches_per_fetch = 3;

template <class Body>
struct Persistent {
    static constexpr bool persistent = true, keeps_rays = false, one_stack = Body::one_stack;
    static constexpr int rays_per_lane = 1;
    using LaneType = typename LaneOf<Body>::Type;
    std::uint32_t next = 0, end = 0;  // rays taken and not yet started

    /// Whether there is a batch, from `next` on.
    template <class Warp>
    RAYDIX_HD bool fetch(Warp& warp, const RayLaunch& launch) {
        if (next == end) {
            next = warp.take(Op::take_rays, *launch.next, batches_per_fetch * Warp::width());
            end = next + batches_per_fetch * Warp::width();
        }
        return next < launch.count;
    }
    template <bool any_hit, class Warp>
    RAYDIX_HD bool turn(Warp& warp, const WarpJob& job, std::uint32_t) {
        if (!fetch(warp, job.launch)) return false;
        start_batch(warp, job.launch, next);
        Body::template trace<any_hit>(warp, job.scene);
        store_hits(warp, job.launch);
        warp.meet();  // else a lane that is done early could start the next batch alone
        next += Warp::width();
        return true;
    }
};

}  // namespace raydix
