// The kernels that look for any hit, compiled apart.
#include "trace/warp/launch_warps.cuh"

namespace raydix {

std::uint32_t resident_blocks_any(const WarpLaunch& launch) {
    return resident_blocks_of<true>(launch);
}

void launch_warps_any(const WarpLaunch& launch, const WarpJob& job, std::int32_t* global_stacks,
                      std::uint32_t blocks, void* stream) {
    launch_warps_of<true>(launch, job, global_stacks, blocks, stream);
}

}  // namespace raydix
