// The rows of OpenCL's devices in the table of backends. Their functions lie in the files
// opencl_*.cpp of this folder.
#pragma once

#include "gpu/launched_backend.h"
#include "gpu/opencl_machine.h"

namespace raydix {

class OpenclBackend final : public LaunchedQueries<OpenclMachine> {
public:
    OpenclBackend(std::uint32_t index, std::unique_ptr<OpenclDevice> device)
        : LaunchedQueries("opencl:" + std::to_string(index), OpenclMachine{device.get()}),
          device_(std::move(device)) {}

    [[nodiscard]] OpenclDevice& device() const { return *device_; }

    std::string name() override;
    void synchronize(Stream stream) override;
    void* allocate(std::size_t bytes) override;
    void free(void* memory) noexcept override;
    void copy_to_device(void* device, const void* host, std::size_t bytes, Stream stream) override;
    void copy_to_host(void* host, const void* device, std::size_t bytes, Stream stream) override;
    double measure_copy(std::size_t bytes, int repeat) override;

    std::unique_ptr<DeviceWarpTree::Arrays> warp_tree(const WarpTree& tree, Stream stream) override;
    std::unique_ptr<DeviceWarpTree::Arrays> warp_tree(const DeviceTree& tree,
                                                      Stream stream) override;
    void trace_warps(const DeviceWarpTree& tree, std::span<const Ray> rays, std::span<TreeHit> hits,
                     const DeviceTraceOptions& options, Scratch scratch, Stream stream) override;
    DeviceTraceMs time_warps(const DeviceWarpTree& tree, std::span<const Ray> rays,
                             std::span<TreeHit> hits, const DeviceTraceOptions& options,
                             Scratch scratch, Stream stream) override;

    void trace_cwbvh(const CwbvhCall& call) override;
    double time_cwbvh(const CwbvhCall& call) override;

private:
    std::unique_ptr<OpenclDevice> device_;
};

}  // namespace raydix
