// The kernels that look for the closest hit, compiled apart.
#include "trace/warp/launch_warps.cuh"

namespace raydix {

std::uint32_t resident_blocks_closest(const WarpLaunch& launch) {
    return resident_blocks_of<false>(launch);
}

void launch_warps_closest(const WarpLaunch& launch, const WarpJob& job, std::int32_t* global_stacks,
                          std::uint32_t blocks, void* stream) {
    launch_warps_of<false>(launch, job, global_stacks, blocks, stream);
}

}  // namespace raydix
