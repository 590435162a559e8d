// The row of CUDA in the table of backends. Its functions lie in the .cu files of this folder.
#pragma once

#include "gpu/launched_backend.h"

namespace raydix {

class CudaLauncher;
class CudaSizer;
class CudaStageTimes;

/// CUDA as gpu/device_run.h wants a machine; cuda_machine.cuh has the rest.
struct CudaMachine {
    using Sizer = CudaSizer;
    using StageTimes = CudaStageTimes;
    static constexpr std::size_t reserved_bytes = 256;  // CudaLauncher's

    [[nodiscard]] CudaLauncher launcher(Stream stream, void* memory, std::size_t bytes) const;
};

class CudaBackend final : public LaunchedQueries<CudaMachine> {
public:
    CudaBackend() : LaunchedQueries("cuda", CudaMachine()) {}

    std::string name() override;
    int enter(const void* memory) override;
    void leave(int before) noexcept override;
    int current() override;
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
};

}  // namespace raydix
