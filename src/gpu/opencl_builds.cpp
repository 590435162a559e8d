// Builds of device_build.h and device_trees.h on an OpenCL queue.
#if defined(RAYDIX_HAVE_OPENCL)

#include "gpu/opencl_backend.h"

namespace raydix {

std::size_t OpenclBackend::scratch_bytes(std::uint32_t n, const BuildOptions& options) {
    return bvh_scratch_bytes<OpenclMachine>(n, options);
}

void OpenclBackend::build(const DeviceMesh& mesh, const BuildOptions& options,
                          const DeviceTree& tree, Scratch scratch, Stream stream) {
    run_on_stream(machine_, build_of(mesh, options, tree), scratch, stream);
}

void OpenclBackend::build(const DeviceBoxList& boxes, const BuildOptions& options,
                          const DeviceTree& tree, Scratch scratch, Stream stream) {
    run_on_stream(machine_, build_of(boxes, options, tree), scratch, stream);
}

BuildMs OpenclBackend::time(const DeviceMesh& mesh, const BuildOptions& options,
                            const DeviceTree& tree, Scratch scratch, Stream stream) {
    return time_on_stream(machine_, build_of(mesh, options, tree), scratch, stream);
}

BuildMs OpenclBackend::time(const DeviceBoxList& boxes, const BuildOptions& options,
                            const DeviceTree& tree, Scratch scratch, Stream stream) {
    return time_on_stream(machine_, build_of(boxes, options, tree), scratch, stream);
}

std::size_t OpenclBackend::scratch_bytes(std::uint32_t n, PrimitiveKind kind,
                                         const KdTreeOptions& options) {
    return kdtree_scratch_bytes<OpenclMachine>(n, kind, options);
}

void OpenclBackend::build(const DeviceMesh& mesh, const KdTreeOptions& options,
                          const DeviceKdArrays& tree, Scratch scratch, Stream stream) {
    run_on_stream(machine_, build_of(mesh, options, tree), scratch, stream);
}

BuildMs OpenclBackend::time(const DeviceMesh& mesh, const KdTreeOptions& options,
                            const DeviceKdArrays& tree, Scratch scratch, Stream stream) {
    return time_on_stream(machine_, build_of(mesh, options, tree), scratch, stream);
}

std::size_t OpenclBackend::scratch_bytes(std::uint32_t n, std::uint32_t node_capacity,
                                         const OctreeOptions& options) {
    return octree_scratch_bytes<OpenclMachine>(n, node_capacity, options);
}

void OpenclBackend::build(const DeviceMesh& mesh, const OctreeOptions& options,
                          const DeviceOctreeArrays& tree, Scratch scratch, Stream stream) {
    run_on_stream(machine_, build_of(mesh, options, tree), scratch, stream);
}

BuildMs OpenclBackend::time(const DeviceMesh& mesh, const OctreeOptions& options,
                            const DeviceOctreeArrays& tree, Scratch scratch, Stream stream) {
    return time_on_stream(machine_, build_of(mesh, options, tree), scratch, stream);
}

}  // namespace raydix

#endif
