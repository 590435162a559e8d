// Rays on a queue of OpenCL or HIP: the kernels of Aila and Laine, and those of compressed wide
// trees.
#if defined(RAYDIX_HAVE_QUEUES)

#include <algorithm>

#include "gpu/cwbvh_arguments.h"
#include "gpu/device_cwbvh.h"
#include "gpu/device_trace.h"
#include "gpu/queue_backend.h"
#include "gpu/trace_arguments.h"

namespace raydix {
namespace {

/// Groups that keep a device busy; a persistent kernel needs no more.
std::uint32_t resident_groups(const KernelDevice& device) {
    return device.compute_units() * (device.is_cpu() ? 2 : 16);
}

std::unique_ptr<DeviceWarpTree::Arrays> with_groups(std::unique_ptr<DeviceWarpTree::Arrays> arrays,
                                                    const KernelDevice& device) {
    for (auto& of_kernel : arrays->resident_blocks) of_kernel.fill(resident_groups(device));
    return arrays;
}

KernelName kernel_of(const WarpLaunch& launch) {
    return with_kernel(launch.kernel, [&]<class Kernel>() {
        return launch.any_hit ? TraceKernel<Kernel>::any : TraceKernel<Kernel>::closest;
    });
}

template <class Mark>
void trace_launches(QueueLauncher launcher, const WarpTraceCall& call, const Mark& mark) {
    call.launch(
        launcher,
        [&](const WarpLaunch& launch, const WarpJob& job, std::int32_t* stacks,
            std::uint32_t groups) {
            const TraceArguments given{job, launch.stack_entries, stacks};
            launcher.device().launch(launcher.queue(), kernel_of(launch), groups,
                                     warp_block_threads, &given, sizeof(given));
        },
        mark);
}

template <class Store>
void launch_cwbvh(QueueLauncher launcher, const DeviceBackend::CwbvhCall& call, const Store& store,
                  const char* one, const char* pool) {
    constexpr std::uint32_t threads = 128;
    auto* next = reinterpret_cast<std::uint32_t*>(call.scratch.data());
    const CwbvhArguments<Store> given{
        {{call.tree.nodes, call.tree.triangles, call.tree.bounds}, call.rays, call.count, store},
        next};
    std::uint32_t groups = (call.count + threads - 1) / threads;
    const bool persistent = call.kernel == CwbvhKernel::persistent_cwbvh;
    if (persistent) {
        launcher.launch("trace.start", 1, StartPool{next});
        groups = std::min(groups, resident_groups(launcher.device()));
    }
    launcher.device().launch(launcher.queue(), {"cwbvh", persistent ? pool : one}, groups, threads,
                             &given, sizeof(given));
}

}  // namespace

std::unique_ptr<DeviceWarpTree::Arrays> QueueBackend::warp_tree(const WarpTree& tree,
                                                                Stream stream) {
    return with_groups(upload_warp_tree(tree, stream), *device_);
}

std::unique_ptr<DeviceWarpTree::Arrays> QueueBackend::warp_tree(const DeviceTree& tree,
                                                                Stream stream) {
    QueueLauncher launcher = plain_launcher(stream);
    return with_groups(take_warp_tree(launcher, tree, stream), *device_);
}

void QueueBackend::trace_warps(const DeviceWarpTree& tree, std::span<const Ray> rays,
                               std::span<TreeHit> hits, const DeviceTraceOptions& options,
                               Scratch scratch, Stream stream) {
    trace_launches(plain_launcher(stream), WarpTraceCall(tree, rays, hits, options, scratch),
                   [](int) {});
}

DeviceTraceMs QueueBackend::time_warps(const DeviceWarpTree& tree, std::span<const Ray> rays,
                                       std::span<TreeHit> hits, const DeviceTraceOptions& options,
                                       Scratch scratch, Stream stream) {
    const Stream queue = device_->queue(stream);
    const auto now = [&] {
        device_->finish(queue);
        return queue_clock_ms();
    };
    double at[2] = {};
    const double start = now();
    trace_launches(plain_launcher(stream), WarpTraceCall(tree, rays, hits, options, scratch),
                   [&](int k) { at[k] = now(); });
    return {at[1] - at[0], now() - start};
}

void QueueBackend::trace_cwbvh(const CwbvhCall& call) {
    check_cwbvh_launch(call);
    if (call.count == 0) return;
    QueueLauncher launcher = plain_launcher(call.stream);
    const bool any = call.occluded != nullptr;
    if (call.tree.node_count == 0) {
        if (any)
            device_->clear(launcher.queue(), call.occluded, call.count);
        else
            launcher.launch("trace.miss", call.count, MissAll{call.hits});
    } else if (any) {
        launch_cwbvh(launcher, call, kernels::StoreOccluded{call.occluded}, "cwbvh_any",
                     "trace_cwbvh_any");
    } else {
        launch_cwbvh(launcher, call, kernels::StoreHit{call.hits}, "cwbvh_closest",
                     "trace_cwbvh_closest");
    }
}

double QueueBackend::time_cwbvh(const CwbvhCall& call) {
    const Stream queue = device_->queue(call.stream);
    device_->finish(queue);
    const double start = queue_clock_ms();
    trace_cwbvh(call);
    device_->finish(queue);
    return queue_clock_ms() - start;
}

}  // namespace raydix

#endif
