// raydix/device_queries.h in a build without CUDA: every call that would need it says so.
#include <raydix/device_queries.h>
#include <raydix/error.h>

#if !defined(RAYDIX_HAVE_CUDA)

namespace raydix {
namespace {

[[noreturn]] void unavailable() {
    throw BackendUnavailable("device cuda: this build of raydix has no CUDA");
}

}  // namespace

std::size_t device_offsets_scratch_bytes(std::uint32_t) { unavailable(); }
void knn_on_device(const DevicePoints&, std::span<const Vec3>, std::uint32_t,
                   std::span<std::uint32_t>, std::span<float>, std::uint32_t*, Stream) {
    unavailable();
}
void radius_count_on_device(const DevicePoints&, std::span<const Vec3>, float,
                            std::span<std::uint64_t>, std::uint32_t*, std::span<std::byte>,
                            Stream) {
    unavailable();
}
void radius_fill_on_device(const DevicePoints&, std::span<const Vec3>, float,
                           std::span<const std::uint64_t>, bool, std::span<std::uint32_t>,
                           std::span<float>, Stream) {
    unavailable();
}
void closest_points_on_device(const DevicePrimitives&, std::span<const Vec3>, float,
                              std::span<ClosestPoint>, std::uint32_t*, Stream) {
    unavailable();
}
void pairs_count_on_device(const DevicePairQuery&, std::span<std::uint64_t>, std::span<std::byte>,
                           Stream) {
    unavailable();
}
void pairs_fill_on_device(const DevicePairQuery&, std::span<const std::uint64_t>,
                          std::span<PrimitivePair>, Stream) {
    unavailable();
}

}  // namespace raydix

#endif
