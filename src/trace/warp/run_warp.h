// A warp of a device, from its first turn to its last: what kernels of all backends are made of.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/device_words.h"
#include "base/hd.h"
#include "simt/thread_warp.h"
#include "trace/warp/batches.h"
#include "trace/warp/lane.h"

namespace raydix {

/// All warps live until their kernel has no turn left, and all lanes as long as their warp.
template <class Kernel, bool any_hit, class Warp>
RAYDIX_HD void run_warp(Warp& warp, const WarpJob& job, std::uint32_t warp_index) {
    Kernel kernel;
    while (kernel.template turn<any_hit>(warp, job, warp_index)) {
    }
}

/// What a warp of work_queue has in shared memory.
struct SpareRays {
    Lane lanes[words::warp_width];
    std::uint32_t slots[words::warp_width];
};

/// Twice as many rays as lanes: thread `thread` of the launch has two of `stacks`, for its own ray
/// and for one that waits. No spare is a ray yet.
template <class Warp>
RAYDIX_HD void lend_spares(Warp& warp, SpareRays& spares, std::int32_t* stacks, std::size_t thread,
                           std::uint32_t stack_entries) {
    warp.memory.spares = spares.lanes;
    warp.memory.slots = spares.slots;
    warp.lane.stack = stacks + 2 * thread * stack_entries;
    Lane& spare = spares.lanes[warp.lane_id()];
    spare.node = finished_node;
    spare.ray = no_ray;
    spare.stack = warp.lane.stack + stack_entries;
    warp.meet();
}

}  // namespace raydix
