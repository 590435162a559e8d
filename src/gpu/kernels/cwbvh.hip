// The kernels of compressed wide trees, as clang compiles them to SPIR-V for OpenCL and to code
// objects for AMD.
#include "gpu/kernels/entry.h"
#include "gpu/cwbvh_arguments.h"

namespace raydix {

#define RAYDIX_CWBVH(name, any, Store)                                          \
    RAYDIX_KERNEL cwbvh_##name(CwbvhArguments<kernels::Store> given) {          \
        const std::uint32_t i = entry::thread();                                \
        if (i < given.rays.count)                                               \
            kernels::trace_cwbvh_ray<any, device_cwbvh_max_depth>(given.rays, i); \
    }                                                                           \
    RAYDIX_KERNEL trace_cwbvh_##name(CwbvhArguments<kernels::Store> given) {    \
        kernels::trace_cwbvh_pool<any, device_cwbvh_max_depth>(given.rays,      \
                                                               given.next);     \
    }
RAYDIX_CWBVH(closest, false, StoreHit)
RAYDIX_CWBVH(any, true, StoreOccluded)

}  // namespace raydix
