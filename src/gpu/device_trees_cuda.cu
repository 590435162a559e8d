// k-d tree and octree on a CUDA stream: device_trees.h.
#include "gpu/device_run.cuh"
#include "gpu/device_trees.h"

namespace raydix {
namespace {

auto with_build(const DeviceMesh& mesh, const KdTreeOptions& options, const DeviceKdArrays& tree) {
    return [=](const auto& visit) { with_device_kdtree(mesh, options, tree, visit); };
}
auto with_build(const DeviceMesh& mesh, const OctreeOptions& options,
                const DeviceOctreeArrays& tree) {
    return [=](const auto& visit) { with_device_octree(mesh, options, tree, visit); };
}

/// For a size: so many primitives and no arrays.
DeviceMesh mesh_of(PrimitiveKind kind, std::uint32_t n) {
    DeviceMesh mesh;
    (kind == PrimitiveKind::points ? mesh.vertex_count : mesh.triangle_count) = n;
    return mesh;
}

}  // namespace

std::size_t device_scratch_bytes(std::uint32_t n, PrimitiveKind kind,
                                 const KdTreeOptions& options) {
    static_cast<void>(device_name());  // says what is missing
    return scratch_size(with_build(mesh_of(kind, n), options, DeviceKdArrays())).all;
}

void build_kdtree_on_device(const DeviceMesh& mesh, const KdTreeOptions& options,
                            const DeviceKdArrays& tree, std::span<std::byte> scratch,
                            Stream stream) {
    run_on_stream(with_build(mesh, options, tree), scratch, stream);
}

BuildMs time_kdtree_on_device(const DeviceMesh& mesh, const KdTreeOptions& options,
                              const DeviceKdArrays& tree, std::span<std::byte> scratch,
                              Stream stream) {
    return time_on_stream(with_build(mesh, options, tree), scratch, stream);
}

std::size_t device_scratch_bytes(std::uint32_t n, std::uint32_t node_capacity,
                                 const OctreeOptions& options) {
    static_cast<void>(device_name());
    DeviceOctreeArrays tree;
    tree.node_capacity = node_capacity;
    return scratch_size(with_build(mesh_of(PrimitiveKind::points, n), options, tree)).all;
}

void build_octree_on_device(const DeviceMesh& mesh, const OctreeOptions& options,
                            const DeviceOctreeArrays& tree, std::span<std::byte> scratch,
                            Stream stream) {
    run_on_stream(with_build(mesh, options, tree), scratch, stream);
}

BuildMs time_octree_on_device(const DeviceMesh& mesh, const OctreeOptions& options,
                              const DeviceOctreeArrays& tree, std::span<std::byte> scratch,
                              Stream stream) {
    return time_on_stream(with_build(mesh, options, tree), scratch, stream);
}

}  // namespace raydix
