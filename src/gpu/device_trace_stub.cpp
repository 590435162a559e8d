// raydix/device_trace.h in a build without CUDA: every call that would need it says so. The others
// take a tree, of which there is none.
#include <raydix/device_trace.h>
#include <raydix/error.h>

#if !defined(RAYDIX_HAVE_CUDA)

#include "gpu/device_trace.h"

namespace raydix {
namespace {

[[noreturn]] void unavailable() {
    throw BackendUnavailable("device cuda: this build of raydix has no CUDA");
}

}  // namespace

DeviceWarpTree::DeviceWarpTree(const WarpTree&, Stream) { unavailable(); }
DeviceWarpTree::DeviceWarpTree(const DeviceTree&, Stream) { unavailable(); }
void trace_warps_on_device(const DeviceWarpTree&, std::span<const Ray>, std::span<TreeHit>,
                           const DeviceTraceOptions&, std::span<std::byte>, Stream) {
    unavailable();
}
DeviceTraceMs time_trace_on_device(const DeviceWarpTree&, std::span<const Ray>, std::span<TreeHit>,
                                   const DeviceTraceOptions&, std::span<std::byte>, Stream) {
    unavailable();
}

}  // namespace raydix

#endif
