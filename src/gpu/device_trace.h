// What stands behind DeviceWarpTree, and the layout of a launch's scratch.
#pragma once

#include <raydix/device_trace.h>
#include <raydix/error.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "base/options.h"
#include "exec/arena.h"
#include "trace/warp/launch_warps.h"

namespace raydix {

inline constexpr std::size_t warp_kernel_count = 11;

struct DeviceWarpTree::Arrays {
    DeviceBuffer<std::byte> own_pairs, own_triangles;  // the former if copied from the host
    DeviceBuffer<std::uint32_t> own_ids;
    WarpScene scene{nullptr, nullptr, nullptr};  // null: no triangles
    std::uint32_t max_depth = 0;
    // Blocks that fill the device, by kernel, closest and any hit: asked for once, not per launch.
    std::array<std::array<std::uint32_t, 2>, warp_kernel_count> resident_blocks{};

    [[nodiscard]] WarpLaunch launch(WarpKernel kernel, bool any_hit) const {
        check_enum("kernel", kernel, WarpKernel::dynamic_fetch);
        return {kernel, any_hit, max_depth + 1};
    }
};

inline void check_stack_depth(std::uint32_t max_depth) {
    if (max_depth >= large_stack_entries)
        throw InputError("the tree is " + std::to_string(max_depth) +
                         " deep; the kernels on a device have stacks for depths up to " +
                         std::to_string(large_stack_entries - 1));
}

/// What a launch works in.
struct DeviceTraceScratch {
    Ray* prepared;
    std::uint32_t* next;
    std::int32_t* stacks;
    std::byte* launcher;  // CudaLauncher's own line

    DeviceTraceScratch(Arena& arena, std::uint32_t count, const WarpLaunch& launch,
                       std::uint32_t blocks)
        : prepared(arena.take<Ray>(count)),
          next(arena.take<std::uint32_t>(1)),
          stacks(arena.take<std::int32_t>(global_stack_entries(launch, blocks))),
          launcher(arena.take<std::byte>(Arena::alignment)) {}
};

/// Blocks of a launch: persistent kernels fill the device, or have a thread for each ray.
inline std::uint32_t blocks_of(const DeviceWarpTree::Arrays& tree, const WarpLaunch& launch,
                               std::uint32_t count) {
    const std::uint32_t all = (count + warp_block_threads - 1) / warp_block_threads;
    if (!is_persistent(launch.kernel)) return all;
    const std::uint32_t resident =
        tree.resident_blocks[static_cast<std::size_t>(launch.kernel)][launch.any_hit ? 1 : 0];
    return resident < all ? resident : all;
}

}  // namespace raydix
