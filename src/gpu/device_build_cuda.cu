// build_bvh_on_device: device_build.h on a CUDA stream.
#include "gpu/device_build.h"
#include "gpu/device_run.cuh"

namespace raydix {
namespace {

template <class Input>
auto with_build(const Input& input, const BuildOptions& options, const DeviceTree& tree) {
    return [=](const auto& visit) { with_device_build(input, options, tree, visit); };
}

}  // namespace

std::size_t device_scratch_bytes(std::uint32_t n, const BuildOptions& options) {
    static_cast<void>(device_name());  // says what is missing
    // The kinds of primitives differ in their copies, which are the caller's.
    DeviceTree tree;
    tree.pairs = reinterpret_cast<NodePair*>(Arena::alignment);  // the larger case
    return scratch_size(with_build(DeviceBoxList{nullptr, n}, options, tree)).all;
}

void build_bvh_on_device(const DeviceMesh& mesh, const BuildOptions& options,
                         const DeviceTree& tree, std::span<std::byte> scratch, Stream stream) {
    run_on_stream(with_build(mesh, options, tree), scratch, stream);
}

void build_bvh_on_device(const DeviceBoxList& boxes, const BuildOptions& options,
                         const DeviceTree& tree, std::span<std::byte> scratch, Stream stream) {
    run_on_stream(with_build(boxes, options, tree), scratch, stream);
}

BuildMs time_build_on_device(const DeviceMesh& mesh, const BuildOptions& options,
                             const DeviceTree& tree, std::span<std::byte> scratch, Stream stream) {
    return time_on_stream(with_build(mesh, options, tree), scratch, stream);
}

BuildMs time_build_on_device(const DeviceBoxList& boxes, const BuildOptions& options,
                             const DeviceTree& tree, std::span<std::byte> scratch, Stream stream) {
    return time_on_stream(with_build(boxes, options, tree), scratch, stream);
}

}  // namespace raydix
