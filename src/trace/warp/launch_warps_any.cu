// The kernels that look for any hit, compiled apart.
#include "trace/warp/launch_warps.cuh"

namespace raydix {

template std::uint32_t resident_blocks_of<true>(const WarpLaunch&);
template void launch_warps_of<true>(const WarpLaunch&, const WarpJob&, std::int32_t*, std::uint32_t,
                                      void*);

}  // namespace raydix
