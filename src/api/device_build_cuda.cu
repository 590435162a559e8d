// build_bvh_on_device: device_build.h on a CUDA stream.
#include <raydix/device.h>
#include <raydix/error.h>

#include <string>

#include "api/device_build.h"
#include "exec/cuda_launcher.cuh"

namespace raydix {
namespace {

template <class Input>
std::size_t sized(const Input& input, const BuildOptions& options) {
    std::size_t bytes = 0;
    DeviceTree tree;
    tree.pairs = reinterpret_cast<NodePair*>(Arena::alignment);  // the larger case
    with_device_build(input, options, tree, [&](const auto& build) {
        Arena arena = sizing_arena();
        CudaSizer sizer;
        build.run(sizer, arena);
        bytes = arena.bytes() + CudaLauncher::reserved_bytes + sizer.bytes();
    });
    return bytes;
}

template <class Input>
void build(const Input& input, const BuildOptions& options, const DeviceTree& tree,
           std::span<std::byte> scratch, Stream stream) {
    with_device_build(input, options, tree, [&](const auto& build) {
        Arena layout = sizing_arena();
        CudaSizer sizer;
        build.run(sizer, layout);
        const std::size_t front = layout.bytes();
        const std::size_t needed = front + CudaLauncher::reserved_bytes + sizer.bytes();
        if (scratch.size() < needed)
            throw InputError("the build wants " + std::to_string(needed) +
                             " bytes of scratch on the device; it was given " +
                             std::to_string(scratch.size()));
        if (reinterpret_cast<std::uintptr_t>(scratch.data()) % Arena::alignment != 0)
            throw InputError("the scratch on the device is not aligned to 256 bytes");
        Arena arena(scratch.data(), front);
        CudaLauncher launcher(static_cast<cudaStream_t>(stream), scratch.data() + front,
                              scratch.size() - front);
        build.run(launcher, arena);
    });
}

}  // namespace

std::size_t device_scratch_bytes(std::uint32_t n, const BuildOptions& options) {
    static_cast<void>(device_name());  // says what is missing
    // The kinds of primitives differ in their copies, which are the caller's.
    return sized(DeviceBoxes{nullptr, n}, options);
}

void build_bvh_on_device(const DeviceMesh& mesh, const BuildOptions& options,
                         const DeviceTree& tree, std::span<std::byte> scratch, Stream stream) {
    build(mesh, options, tree, scratch, stream);
}

void build_bvh_on_device(const DeviceBoxes& boxes, const BuildOptions& options,
                         const DeviceTree& tree, std::span<std::byte> scratch, Stream stream) {
    build(boxes, options, tree, scratch, stream);
}

}  // namespace raydix
