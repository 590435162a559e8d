// raydix/device_trace.h on a CUDA device: trees in the kernels' form, then rays prepared, traced
// and scaled back, launch after launch on one stream.
#include <raydix/device_trace.h>
#include <raydix/error.h>

#include <cstdint>
#include <memory>
#include <string>

#include "exec/cuda_launcher.cuh"
#include "gpu/cuda_backend.h"
#include "gpu/device_trace.h"
#include "layout/warp_tree.h"
#include "layout/woop48.h"
#include "trace/warp/prepare_rays.h"

namespace raydix {
namespace {

void find_resident_blocks(DeviceWarpTree::Arrays& tree) {
    for (const WarpKernel kernel : warp_kernels())
        for (const bool any_hit : {false, true})
            if (is_persistent(kernel))
                tree.resident_blocks[static_cast<std::size_t>(kernel)][any_hit ? 1 : 0] =
                    resident_blocks(tree.launch(kernel, any_hit));
}

/// For a few launches of functors, none of which scans or sorts.
CudaLauncher plain_launcher(Stream stream, std::byte* line) {
    return {static_cast<cudaStream_t>(stream), line, CudaLauncher::reserved_bytes};
}

/// `mark(k)` is called before (0) and behind (1) the traversal kernel.
template <class Mark>
void trace_launches(const DeviceWarpTree& tree, std::span<const Ray> rays, std::span<TreeHit> hits,
                    const DeviceTraceOptions& options, std::span<std::byte> scratch, Stream stream,
                    const Mark& mark) {
    const WarpTraceCall call(tree, rays, hits, options, scratch);
    CudaLauncher launcher = plain_launcher(stream, call.work().launcher);
    call.launch(
        launcher,
        [&](const WarpLaunch& launch, const WarpJob& job, std::int32_t* stacks,
            std::uint32_t blocks) {
            const ProfilerRange range("trace.warps");
            launch_warps(launch, job, stacks, blocks, stream);
        },
        mark);
}

class Event {
public:
    Event() { RAYDIX_CUDA_TRY(cudaEventCreate(&event_)); }
    Event(const Event&) = delete;
    Event& operator=(const Event&) = delete;
    ~Event() { static_cast<void>(cudaEventDestroy(event_)); }
    void record(Stream stream) {
        RAYDIX_CUDA_TRY(cudaEventRecord(event_, static_cast<cudaStream_t>(stream)));
    }
    [[nodiscard]] double ms_since(const Event& start) const {
        RAYDIX_CUDA_TRY(cudaEventSynchronize(event_));
        float ms = 0;
        RAYDIX_CUDA_TRY(cudaEventElapsedTime(&ms, start.event_, event_));
        return ms;
    }

private:
    cudaEvent_t event_ = nullptr;
};

}  // namespace

std::unique_ptr<DeviceWarpTree::Arrays> CudaBackend::warp_tree(const WarpTree& tree,
                                                               Stream stream) {
    static_cast<void>(name());  // says what is missing
    auto arrays = upload_warp_tree(tree, stream);
    if (arrays->scene.pairs != nullptr) find_resident_blocks(*arrays);
    return arrays;
}

std::unique_ptr<DeviceWarpTree::Arrays> CudaBackend::warp_tree(const DeviceTree& tree,
                                                               Stream stream) {
    static_cast<void>(name());
    CudaLauncher launcher = plain_launcher(stream, nullptr);
    auto arrays = take_warp_tree(launcher, tree, stream);
    if (arrays->scene.pairs != nullptr) find_resident_blocks(*arrays);
    return arrays;
}

void CudaBackend::trace_warps(const DeviceWarpTree& tree, std::span<const Ray> rays,
                              std::span<TreeHit> hits, const DeviceTraceOptions& options,
                              std::span<std::byte> scratch, Stream stream) {
    trace_launches(tree, rays, hits, options, scratch, stream, [](int) {});
}

DeviceTraceMs CudaBackend::time_warps(const DeviceWarpTree& tree, std::span<const Ray> rays,
                                      std::span<TreeHit> hits, const DeviceTraceOptions& options,
                                      std::span<std::byte> scratch, Stream stream) {
    Event start, before, behind, end;
    start.record(stream);
    trace_launches(tree, rays, hits, options, scratch, stream,
                   [&](int k) { (k == 0 ? before : behind).record(stream); });
    end.record(stream);
    DeviceTraceMs ms;
    ms.total = end.ms_since(start);
    ms.kernel = behind.ms_since(before);
    return ms;
}

}  // namespace raydix
