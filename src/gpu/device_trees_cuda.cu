// k-d trees and octrees of device_trees.h on a CUDA stream.
#include "gpu/cuda_backend.h"
#include "gpu/cuda_machine.cuh"
#include "gpu/device_trees.h"

namespace raydix {

std::size_t CudaBackend::scratch_bytes(std::uint32_t n, PrimitiveKind kind,
                                       const KdTreeOptions& options) {
    static_cast<void>(name());  // says what is missing
    return kdtree_scratch_bytes<CudaMachine>(n, kind, options);
}

void CudaBackend::build(const DeviceMesh& mesh, const KdTreeOptions& options,
                        const DeviceKdArrays& tree, Scratch scratch, Stream stream) {
    run_on_stream(CudaMachine(), build_of(mesh, options, tree), scratch, stream);
}

BuildMs CudaBackend::time(const DeviceMesh& mesh, const KdTreeOptions& options,
                          const DeviceKdArrays& tree, Scratch scratch, Stream stream) {
    return time_on_stream(CudaMachine(), build_of(mesh, options, tree), scratch, stream);
}

std::size_t CudaBackend::scratch_bytes(std::uint32_t n, std::uint32_t node_capacity,
                                       const OctreeOptions& options) {
    static_cast<void>(name());
    return octree_scratch_bytes<CudaMachine>(n, node_capacity, options);
}

void CudaBackend::build(const DeviceMesh& mesh, const OctreeOptions& options,
                        const DeviceOctreeArrays& tree, Scratch scratch, Stream stream) {
    run_on_stream(CudaMachine(), build_of(mesh, options, tree), scratch, stream);
}

BuildMs CudaBackend::time(const DeviceMesh& mesh, const OctreeOptions& options,
                          const DeviceOctreeArrays& tree, Scratch scratch, Stream stream) {
    return time_on_stream(CudaMachine(), build_of(mesh, options, tree), scratch, stream);
}

}  // namespace raydix
