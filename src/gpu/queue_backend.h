// The rows of OpenCL's and HIP's devices in the table of backends. Their functions lie in the files
// queue_*.cpp of this folder.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "gpu/launched_backend.h"
#include "gpu/queue_machine.h"

namespace raydix {

class QueueBackend final : public LaunchedQueries<QueueMachine> {
public:
    QueueBackend(std::string selector, std::unique_ptr<KernelDevice> device)
        : LaunchedQueries(std::move(selector), QueueMachine{device.get()}),
          device_(std::move(device)) {}

    [[nodiscard]] KernelDevice& device() const { return *device_; }

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
    std::unique_ptr<KernelDevice> device_;
};

/// The backend of a kind of device with this number, opened when it is first asked for. Never
/// destroyed: at the end of the process the driver may be gone before it is.
class QueueBackends {
public:
    template <class Open>
    [[nodiscard]] QueueBackend& at(const std::string& kind, std::uint32_t index, const Open& open) {
        const std::lock_guard guard(lock_);
        std::unique_ptr<QueueBackend>& backend = backends_[index];
        if (backend == nullptr)
            backend =
                std::make_unique<QueueBackend>(kind + ':' + std::to_string(index), open(index));
        return *backend;
    }

private:
    std::mutex lock_;
    std::map<std::uint32_t, std::unique_ptr<QueueBackend>> backends_;
};

}  // namespace raydix
