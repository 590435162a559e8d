// raydix/device_trace.h on a CUDA device: trees in the kernels' form, then rays prepared, traced
// and scaled back, launch after launch on one stream.
#include <raydix/device_trace.h>
#include <raydix/error.h>

#include <cstdint>
#include <memory>
#include <string>

#include "exec/cuda_event.cuh"
#include "gpu/cuda_machine.cuh"
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

/// `mark(k)` is called before (0) and behind (1) the traversal kernel.
template <class Mark>
void trace_launches(const DeviceWarpTree& tree, std::span<const Ray> rays, std::span<TreeHit> hits,
                    const DeviceTraceOptions& options, std::span<std::byte> scratch, Stream stream,
                    const Mark& mark) {
    const WarpTraceCall call(tree, rays, hits, options, scratch);
    CudaLauncher launcher(static_cast<cudaStream_t>(stream), call.work().launcher,
                          CudaLauncher::reserved_bytes);
    call.launch(
        launcher,
        [&](const WarpLaunch& launch, const WarpJob& job, std::int32_t* stacks,
            std::uint32_t blocks) {
            const ProfilerRange range("trace.warps");
            launch_warps(launch, job, stacks, blocks, stream);
        },
        mark);
}

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
    CudaLauncher launcher = plain_launcher(stream);
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
    CudaEvent start, before, behind, end;
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
