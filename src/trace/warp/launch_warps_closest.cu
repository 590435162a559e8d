// The kernels that look for the closest hit, compiled apart.
#include "trace/warp/launch_warps.cuh"

namespace raydix {

template std::uint32_t resident_blocks_of<false>(const WarpLaunch&);
template void launch_warps_of<false>(const WarpLaunch&, const WarpJob&, std::int32_t*, std::uint32_t,
                                      void*);

}  // namespace raydix
