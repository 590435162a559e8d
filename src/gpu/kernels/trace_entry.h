// A thread of a traversal kernel, and what the warps of its group share.
#pragma once

#include "gpu/kernels/entry.h"
#include "gpu/trace_arguments.h"
#include "trace/warp/kernel_list.h"
#include "trace/warp/launch_warps.h"
#include "trace/warp/run_warp.h"

namespace raydix {
namespace entry {

inline constexpr std::uint32_t warps_per_group = warp_block_threads / words::warp_width;

/// What the warps of a group share, by their number in it.
template <class Each>
__device__ Each& of_this_warp(std::uint64_t* words) {
    return reinterpret_cast<Each*>(words)[__gpu_thread_id_x() / warp_lanes];
}

struct PacketStack {
    std::int32_t entries[large_stack_entries];
};

template <class Kernel, bool any_hit>
__device__ void trace(const TraceArguments& given) {
    ThreadWarp<typename LaneOf<Kernel>::Type> warp;
    const std::uint32_t warp_index = thread() / warp_lanes;
    if constexpr (Kernel::one_stack) {
        __shared__ std::uint64_t shared[warps_per_group * sizeof(PacketStack) / 8];
        warp.memory.packet_stack = of_this_warp<PacketStack>(shared).entries;
        run_warp<Kernel, any_hit>(warp, given.job, warp_index);
    } else if constexpr (Kernel::rays_per_lane == 2) {
        __shared__ std::uint64_t shared[warps_per_group * sizeof(SpareRays) / 8];
        lend_spares(warp, of_this_warp<SpareRays>(shared), given.stacks, thread(),
                    given.stack_entries);
        run_warp<Kernel, any_hit>(warp, given.job, warp_index);
    } else {
        std::int32_t stack[large_stack_entries];
        warp.lane.stack = stack;
        run_warp<Kernel, any_hit>(warp, given.job, warp_index);
    }
}

}  // namespace entry
}  // namespace raydix

#define RAYDIX_TRACE(name, ...)                                  \
    RAYDIX_KERNEL trace_##name##_closest(TraceArguments given) { \
        entry::trace<__VA_ARGS__, false>(given);                 \
    }                                                            \
    RAYDIX_KERNEL trace_##name##_any(TraceArguments given) {     \
        entry::trace<__VA_ARGS__, true>(given);                  \
    }
