// Builds of device_build.h on a CUDA stream.
#include "gpu/cuda_backend.h"
#include "gpu/cuda_machine.cuh"
#include "gpu/device_build.h"

namespace raydix {

std::size_t CudaBackend::scratch_bytes(std::uint32_t n, const BuildOptions& options) {
    static_cast<void>(name());  // says what is missing
    return bvh_scratch_bytes<CudaMachine>(n, options);
}

void CudaBackend::build(const DeviceMesh& mesh, const BuildOptions& options, const DeviceTree& tree,
                        Scratch scratch, Stream stream) {
    run_on_stream(CudaMachine(), build_of(mesh, options, tree), scratch, stream);
}

void CudaBackend::build(const DeviceBoxList& boxes, const BuildOptions& options,
                        const DeviceTree& tree, Scratch scratch, Stream stream) {
    run_on_stream(CudaMachine(), build_of(boxes, options, tree), scratch, stream);
}

BuildMs CudaBackend::time(const DeviceMesh& mesh, const BuildOptions& options,
                          const DeviceTree& tree, Scratch scratch, Stream stream) {
    return time_on_stream(CudaMachine(), build_of(mesh, options, tree), scratch, stream);
}

BuildMs CudaBackend::time(const DeviceBoxList& boxes, const BuildOptions& options,
                          const DeviceTree& tree, Scratch scratch, Stream stream) {
    return time_on_stream(CudaMachine(), build_of(boxes, options, tree), scratch, stream);
}

}  // namespace raydix
