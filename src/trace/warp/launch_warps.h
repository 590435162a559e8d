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

/// Stacks in global memory, of kernels whose lanes hand rays, and with them the stacks, to others;
/// in entries.
inline std::size_t global_stack_entries(const WarpLaunch& launch, std::uint32_t blocks) {
    return with_kernel(launch.kernel, [&]<class Kernel>() -> std::size_t {
        if (Kernel::rays_per_lane == 1) return 0;
        return std::size_t{blocks} * warp_block_threads * Kernel::rays_per_lane *
               launch.stack_entries;
    });
}

inline bool is_persistent(WarpKernel kernel) {
    bool persistent = false;
    with_kernel(kernel, [&]<class Kernel>() { persistent = Kernel::persistent; });
    return persistent;
}

/// Blocks that fill the current device. Asks the runtime: not for each launch.
[[nodiscard]] std::uint32_t resident_blocks_closest(const WarpLaunch& launch);
[[nodiscard]] std::uint32_t resident_blocks_any(const WarpLaunch& launch);
[[nodiscard]] inline std::uint32_t resident_blocks(const WarpLaunch& launch) {
    return launch.any_hit ? resident_blocks_any(launch) : resident_blocks_closest(launch);
}

void launch_warps_closest(const WarpLaunch& launch, const WarpJob& job, std::int32_t* global_stacks,
                          std::uint32_t blocks, void* stream);
void launch_warps_any(const WarpLaunch& launch, const WarpJob& job, std::int32_t* global_stacks,
                      std::uint32_t blocks, void* stream);
/// Puts the kernel on `stream` (a cudaStream_t). *job.launch.next must be 0 by then;
/// `global_stacks` [global_stack_entries]. Throws DeviceError.
inline void launch_warps(const WarpLaunch& launch, const WarpJob& job, std::int32_t* global_stacks,
                         std::uint32_t blocks, void* stream) {
    const auto start = launch.any_hit ? launch_warps_any : launch_warps_closest;
    start(launch, job, global_stacks, blocks, stream);
}

}  // namespace raydix
