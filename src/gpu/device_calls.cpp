// The public calls of raydix/device*.h: each goes to the backend that the thread has selected.
#include "engine/name_hit.h"
#include "gpu/backend.h"
#include "gpu/device_trace.h"

namespace raydix {

bool device_available() noexcept {
    try {
        static_cast<void>(device_backend().name());
        return true;
    } catch (const std::exception&) {
        return false;
    }
}
std::string device_name() { return device_backend().name(); }
void synchronize(Stream stream) { device_backend().synchronize(stream); }

OnDeviceOf::OnDeviceOf(const void* memory)
    : backend_(&device_backend()), before_(backend_->enter(memory)) {}
OnDeviceOf::~OnDeviceOf() { backend_->leave(before_); }
int OnDeviceOf::index() const { return backend_->current(); }

double measure_device_copy(std::size_t bytes, int repeat) {
    return device_backend().measure_copy(bytes, repeat);
}

namespace detail {

DeviceMemory device_allocate(std::size_t bytes) {
    DeviceBackend& backend = device_backend();
    if (bytes == 0) return {nullptr, &backend};
    static_cast<void>(backend.name());  // says if there is no device
    // Backends round up to lines.
    if (bytes > std::numeric_limits<std::size_t>::max() / 2)
        throw DeviceError("device " + backend.selector() +
                          ": no memory has 2^63 bytes and more, which an array was to take");
    return {backend.allocate(bytes), &backend};
}
void device_free(const DeviceMemory& memory) noexcept {
    if (memory.data != nullptr) memory.owner->free(memory.data);
}
void copy_to_device(void* device, const void* host, std::size_t bytes, Stream stream) {
    if (bytes == 0) return;
    const OnDeviceOf on(device);
    device_backend().copy_to_device(device, host, bytes, stream);
}
void copy_to_host(void* host, const void* device, std::size_t bytes, Stream stream) {
    if (bytes == 0) return;
    const OnDeviceOf on(device);
    device_backend().copy_to_host(host, device, bytes, stream);
}

}  // namespace detail

std::size_t device_scratch_bytes(std::uint32_t n, const BuildOptions& options) {
    return device_backend().scratch_bytes(n, options);
}
void build_bvh_on_device(const DeviceMesh& mesh, const BuildOptions& options,
                         const DeviceTree& tree, std::span<std::byte> scratch, Stream stream) {
    const OnDeviceOf on(scratch.data());
    device_backend().build(mesh, options, tree, scratch, stream);
}
void build_bvh_on_device(const DeviceBoxList& boxes, const BuildOptions& options,
                         const DeviceTree& tree, std::span<std::byte> scratch, Stream stream) {
    const OnDeviceOf on(scratch.data());
    device_backend().build(boxes, options, tree, scratch, stream);
}
BuildMs time_build_on_device(const DeviceMesh& mesh, const BuildOptions& options,
                             const DeviceTree& tree, std::span<std::byte> scratch, Stream stream) {
    const OnDeviceOf on(scratch.data());
    return device_backend().time(mesh, options, tree, scratch, stream);
}
BuildMs time_build_on_device(const DeviceBoxList& boxes, const BuildOptions& options,
                             const DeviceTree& tree, std::span<std::byte> scratch, Stream stream) {
    const OnDeviceOf on(scratch.data());
    return device_backend().time(boxes, options, tree, scratch, stream);
}

std::size_t device_scratch_bytes(std::uint32_t n, PrimitiveKind kind,
                                 const KdTreeOptions& options) {
    return device_backend().scratch_bytes(n, kind, options);
}
void build_kdtree_on_device(const DeviceMesh& mesh, const KdTreeOptions& options,
                            const DeviceKdArrays& tree, std::span<std::byte> scratch,
                            Stream stream) {
    const OnDeviceOf on(scratch.data());
    device_backend().build(mesh, options, tree, scratch, stream);
}
BuildMs time_kdtree_on_device(const DeviceMesh& mesh, const KdTreeOptions& options,
                              const DeviceKdArrays& tree, std::span<std::byte> scratch,
                              Stream stream) {
    const OnDeviceOf on(scratch.data());
    return device_backend().time(mesh, options, tree, scratch, stream);
}
std::size_t device_scratch_bytes(std::uint32_t n, std::uint32_t node_capacity,
                                 const OctreeOptions& options) {
    return device_backend().scratch_bytes(n, node_capacity, options);
}
void build_octree_on_device(const DeviceMesh& mesh, const OctreeOptions& options,
                            const DeviceOctreeArrays& tree, std::span<std::byte> scratch,
                            Stream stream) {
    const OnDeviceOf on(scratch.data());
    device_backend().build(mesh, options, tree, scratch, stream);
}
BuildMs time_octree_on_device(const DeviceMesh& mesh, const OctreeOptions& options,
                              const DeviceOctreeArrays& tree, std::span<std::byte> scratch,
                              Stream stream) {
    const OnDeviceOf on(scratch.data());
    return device_backend().time(mesh, options, tree, scratch, stream);
}

std::unique_ptr<DeviceWarpTree::Arrays> DeviceBackend::warp_tree(const WarpTree&, Stream) {
    missing("the kernels of Aila and Laine");
}
std::unique_ptr<DeviceWarpTree::Arrays> DeviceBackend::warp_tree(const DeviceTree&, Stream) {
    missing("the kernels of Aila and Laine");
}
DeviceWarpTree::DeviceWarpTree(const WarpTree& tree, Stream stream)
    : arrays_(device_backend().warp_tree(tree, stream)) {}
DeviceWarpTree::DeviceWarpTree(const DeviceTree& tree, Stream stream) {
    const OnDeviceOf on(tree.counts);
    arrays_ = device_backend().warp_tree(tree, stream);
}
void trace_warps_on_device(const DeviceWarpTree& tree, std::span<const Ray> rays,
                           std::span<TreeHit> hits, const DeviceTraceOptions& options,
                           std::span<std::byte> scratch, Stream stream) {
    const OnDeviceOf on(scratch.data());
    device_backend().trace_warps(tree, rays, hits, options, scratch, stream);
}
DeviceTraceMs time_trace_on_device(const DeviceWarpTree& tree, std::span<const Ray> rays,
                                   std::span<TreeHit> hits, const DeviceTraceOptions& options,
                                   std::span<std::byte> scratch, Stream stream) {
    const OnDeviceOf on(scratch.data());
    return device_backend().time_warps(tree, rays, hits, options, scratch, stream);
}

namespace {
/// Any memory of the call: a tree may have none.
const void* memory_of(const DeviceCwbvhTree& tree, const Ray* rays) {
    return tree.nodes != nullptr ? static_cast<const void*>(tree.nodes) : rays;
}
}  // namespace

void trace_on_device(const DeviceCwbvhTree& tree, const Ray* rays, std::uint32_t count,
                     TreeHit* hits, CwbvhKernel kernel, std::span<std::byte> scratch,
                     Stream stream) {
    const OnDeviceOf on(memory_of(tree, rays));
    device_backend().trace_cwbvh({tree, rays, count, hits, nullptr, kernel, scratch, stream});
}
void trace_any_on_device(const DeviceCwbvhTree& tree, const Ray* rays, std::uint32_t count,
                         std::uint8_t* occluded, CwbvhKernel kernel, std::span<std::byte> scratch,
                         Stream stream) {
    const OnDeviceOf on(memory_of(tree, rays));
    device_backend().trace_cwbvh({tree, rays, count, nullptr, occluded, kernel, scratch, stream});
}
double time_trace_on_device(const DeviceCwbvhTree& tree, const Ray* rays, std::uint32_t count,
                            TreeHit* hits, CwbvhKernel kernel, std::span<std::byte> scratch,
                            Stream stream) {
    const OnDeviceOf on(memory_of(tree, rays));
    return device_backend().time_cwbvh({tree, rays, count, hits, nullptr, kernel, scratch, stream});
}
double time_trace_any_on_device(const DeviceCwbvhTree& tree, const Ray* rays, std::uint32_t count,
                                std::uint8_t* occluded, CwbvhKernel kernel,
                                std::span<std::byte> scratch, Stream stream) {
    const OnDeviceOf on(memory_of(tree, rays));
    return device_backend().time_cwbvh(
        {tree, rays, count, nullptr, occluded, kernel, scratch, stream});
}

std::size_t device_offsets_scratch_bytes(std::uint32_t n) {
    return device_backend().offsets_scratch_bytes(n);
}
void knn_on_device(const DevicePoints& tree, std::span<const Vec3> queries, std::uint32_t k,
                   std::span<std::uint32_t> indices, std::span<float> distances,
                   std::uint32_t* invalid, Stream stream) {
    const OnDeviceOf on(tree.nodes);
    device_backend().knn(tree, queries, k, indices, distances, invalid, stream);
}
void radius_count_on_device(const DevicePoints& tree, std::span<const Vec3> queries, float radius,
                            std::span<std::uint64_t> offsets, std::uint32_t* invalid,
                            std::span<std::byte> scratch, Stream stream) {
    const OnDeviceOf on(tree.nodes);
    device_backend().radius_count(tree, queries, radius, offsets, invalid, scratch, stream);
}
void radius_fill_on_device(const DevicePoints& tree, std::span<const Vec3> queries, float radius,
                           std::span<const std::uint64_t> offsets, bool by_distance,
                           std::span<std::uint32_t> indices, std::span<float> distances,
                           Stream stream) {
    const OnDeviceOf on(tree.nodes);
    device_backend().radius_fill(tree, queries, radius, offsets, by_distance, indices, distances,
                                 stream);
}
void closest_points_on_device(const DevicePrimitives& tree, std::span<const Vec3> queries,
                              float max_distance, std::span<ClosestPoint> results,
                              std::uint32_t* invalid, Stream stream) {
    const OnDeviceOf on(tree.nodes);
    device_backend().closest_points(tree, queries, max_distance, results, invalid, stream);
}
void pairs_count_on_device(const DevicePairQuery& query, std::span<std::uint64_t> offsets,
                           std::span<std::byte> scratch, Stream stream) {
    const OnDeviceOf on(query.a.nodes);
    device_backend().pairs_count(query, offsets, scratch, stream);
}
void pairs_fill_on_device(const DevicePairQuery& query, std::span<const std::uint64_t> offsets,
                          std::span<PrimitivePair> pairs, Stream stream) {
    const OnDeviceOf on(query.a.nodes);
    device_backend().pairs_fill(query, offsets, pairs, stream);
}

void name_hits_on_device(const DeviceMeshNames& names, std::span<const TreeHit> found,
                         std::span<Hit> hits, Stream stream) {
    const OnDeviceOf on(found.data());
    device_backend().name_hits(names, found, hits, stream);
}

}  // namespace raydix
