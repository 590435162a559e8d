// raydix/device_cwbvh.h in a build without CUDA: every call that would need it says so.
#include <raydix/device_cwbvh.h>
#include <raydix/error.h>

#if !defined(RAYDIX_HAVE_CUDA)

namespace raydix {
namespace {

[[noreturn]] void unavailable() {
    throw BackendUnavailable("device cuda: this build of raydix has no CUDA");
}

}  // namespace

void trace_on_device(const DeviceCwbvhTree&, const Ray*, std::uint32_t, TreeHit*, CwbvhKernel,
                     std::span<std::byte>, Stream) {
    unavailable();
}
void trace_any_on_device(const DeviceCwbvhTree&, const Ray*, std::uint32_t, std::uint8_t*,
                         CwbvhKernel, std::span<std::byte>, Stream) {
    unavailable();
}
double time_trace_on_device(const DeviceCwbvhTree&, const Ray*, std::uint32_t, TreeHit*,
                            CwbvhKernel, std::span<std::byte>, Stream) {
    unavailable();
}
double time_trace_any_on_device(const DeviceCwbvhTree&, const Ray*, std::uint32_t, std::uint8_t*,
                                CwbvhKernel, std::span<std::byte>, Stream) {
    unavailable();
}

}  // namespace raydix

#endif
