// raydix/device.h and device_trees.h in a build without CUDA: every call that would need it says
// so.
#include <raydix/device_trees.h>
#include <raydix/error.h>

#if !defined(RAYDIX_HAVE_CUDA)

namespace raydix {
namespace {

[[noreturn]] void unavailable() {
    throw BackendUnavailable("device cuda: this build of raydix has no CUDA");
}

}  // namespace

bool device_available() noexcept { return false; }
std::string device_name() { unavailable(); }
void synchronize(Stream) { unavailable(); }

namespace detail {
void* device_allocate(std::size_t) { unavailable(); }
void device_free(void*) noexcept {}
void copy_to_device(void*, const void*, std::size_t, Stream) { unavailable(); }
void copy_to_host(void*, const void*, std::size_t, Stream) { unavailable(); }
}  // namespace detail

std::size_t device_scratch_bytes(std::uint32_t, const BuildOptions&) { unavailable(); }
void build_bvh_on_device(const DeviceMesh&, const BuildOptions&, const DeviceTree&,
                         std::span<std::byte>, Stream) {
    unavailable();
}
void build_bvh_on_device(const DeviceBoxList&, const BuildOptions&, const DeviceTree&,
                         std::span<std::byte>, Stream) {
    unavailable();
}
BuildMs time_build_on_device(const DeviceMesh&, const BuildOptions&, const DeviceTree&,
                             std::span<std::byte>, Stream) {
    unavailable();
}
BuildMs time_build_on_device(const DeviceBoxList&, const BuildOptions&, const DeviceTree&,
                             std::span<std::byte>, Stream) {
    unavailable();
}
double measure_device_copy(std::size_t, int) { unavailable(); }

std::size_t device_scratch_bytes(std::uint32_t, PrimitiveKind, const KdTreeOptions&) {
    unavailable();
}
void build_kdtree_on_device(const DeviceMesh&, const KdTreeOptions&, const DeviceKdArrays&,
                            std::span<std::byte>, Stream) {
    unavailable();
}
BuildMs time_kdtree_on_device(const DeviceMesh&, const KdTreeOptions&, const DeviceKdArrays&,
                              std::span<std::byte>, Stream) {
    unavailable();
}
std::size_t device_scratch_bytes(std::uint32_t, std::uint32_t, const OctreeOptions&) {
    unavailable();
}
void build_octree_on_device(const DeviceMesh&, const OctreeOptions&, const DeviceOctreeArrays&,
                            std::span<std::byte>, Stream) {
    unavailable();
}
BuildMs time_octree_on_device(const DeviceMesh&, const OctreeOptions&, const DeviceOctreeArrays&,
                              std::span<std::byte>, Stream) {
    unavailable();
}

}  // namespace raydix

#endif
