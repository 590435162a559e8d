// The warp kernels on a CUDA device, as host code calls them: one launch, on a stream, of prepared
// rays.
#pragma once

#include <raydix/simulate.h>

#include <cstddef>
#include <cstdint>

#include "trace/warp/batches.h"
#include "trace/warp/kernel_list.h"

namespace raydix {

/// Threads of a block. 4 warps, as in Aila and Laine's release for Fermi.
inline constexpr std::uint32_t warp_block_threads = 128;
/// A thread's stack is an array of a fixed size: of the smallest of these that the tree fits.
inline constexpr std::uint32_t small_stack_entries = 64, large_stack_entries = 128;

struct WarpLaunch {
    WarpKernel kernel;
    bool any_hit;
    std::uint32_t stack_entries;  // [1, large_stack_entries], the tree's depth + 1
};

/// Rays per lane of work_queue's launches lie in stacks of global memory: a lane may hand its ray,
/// and with it the stack, to another.
inline std::size_t global_stack_entries(const WarpLaunch& launch, std::uint32_t blocks) {
    return with_kernel(launch.kernel, [&]<class Kernel>() -> std::size_t {
        if (Kernel::rays_per_lane == 1) return 0;
        return std::size_t{blocks} * warp_block_threads * Kernel::rays_per_lane *
               launch.stack_entries;
    });
}

inline bool is_persistent(WarpKernel kernel) {
    return with_kernel(kernel, []<class Kernel>() { return Kernel::persistent; });
}

/// Blocks that fill the current device. Asks the runtime: not for each launch.
[[nodiscard]] std::uint32_t resident_blocks(const WarpLaunch& launch);

/// Puts the kernel on `stream` (a cudaStream_t). job.launch.next must be 0 by then, `global_stacks`
/// [global_stack_entries] long. Throws DeviceError.
void launch_warps(const WarpLaunch& launch, const WarpJob& job, std::int32_t* global_stacks,
                  std::uint32_t blocks, void* stream);

}  // namespace raydix
