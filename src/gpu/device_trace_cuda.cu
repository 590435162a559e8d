// raydix/device_trace.h on a CUDA device: trees in the kernels' form, then rays prepared, traced
// and scaled back, launch after launch on one stream.
#include <raydix/device_trace.h>
#include <raydix/error.h>

#include <cstdint>
#include <memory>
#include <string>

#include "exec/cuda_launcher.cuh"
#include "gpu/device_trace.h"
#include "layout/warp_tree.h"
#include "layout/woop48.h"
#include "trace/warp/prepare_rays.h"

namespace raydix {
namespace {

/// A tree without triangles.
struct MissAll {
    TreeHit* hits;  // [n], out
    RAYDIX_HD void operator()(std::uint32_t i) const {
        hits[i] = TreeHit{infinity, no_primitive, 0, 0};
    }
};

void find_resident_blocks(DeviceWarpTree::Arrays& tree) {
    for (const WarpKernel kernel : warp_kernels())
        for (const bool any_hit : {false, true})
            if (is_persistent(kernel))
                tree.resident_blocks[static_cast<std::size_t>(kernel)][any_hit ? 1 : 0] =
                    resident_blocks(tree.launch(kernel, any_hit));
}

template <class T>
const T* upload(DeviceBuffer<std::byte>& to, const T* from, std::size_t count, Stream stream) {
    to.upload({reinterpret_cast<const std::byte*>(from), count * sizeof(T)}, stream);
    return reinterpret_cast<const T*>(to.data());
}

/// For a few launches of functors, none of which scans or sorts.
CudaLauncher plain_launcher(Stream stream, std::byte* line) {
    return {static_cast<cudaStream_t>(stream), line, CudaLauncher::reserved_bytes};
}

void check_memory(std::span<const Ray> rays, std::span<TreeHit> hits, std::span<std::byte> scratch,
                  std::size_t needed) {
    const auto aligned = [](const void* at, std::uintptr_t to) {
        return reinterpret_cast<std::uintptr_t>(at) % to == 0;
    };
    if (rays.size() != hits.size())
        throw InputError(std::to_string(rays.size()) + " rays, but room for " +
                         std::to_string(hits.size()) + " hits");
    if (!aligned(rays.data(), 16) || !aligned(hits.data(), 16))
        throw InputError("rays and hits on the device are not aligned to 16 bytes");
    if (scratch.size() < needed)
        throw InputError("the launch wants " + std::to_string(needed) +
                         " bytes of scratch on the device; it was given " +
                         std::to_string(scratch.size()));
    if (!aligned(scratch.data(), Arena::alignment))
        throw InputError("the scratch on the device is not aligned to 256 bytes");
}

/// `mark(k)` is called before (0) and behind (1) the traversal kernel.
template <class Mark>
void trace_launches(const DeviceWarpTree& tree, std::span<const Ray> rays, std::span<TreeHit> hits,
                    const DeviceTraceOptions& options, std::span<std::byte> scratch, Stream stream,
                    const Mark& mark) {
    if (rays.size() >= 0x7FFFFFFFu) throw InputError("2^31 rays or more in one launch");
    const auto count = static_cast<std::uint32_t>(rays.size());
    check_memory(rays, hits, scratch, device_trace_scratch_bytes(tree, count, options));
    const WarpLaunch launch = tree.arrays().launch(options.kernel, options.any_hit);
    const std::uint32_t blocks = blocks_of(tree.arrays(), launch, count);
    Arena arena(scratch.data(), scratch.size());
    const DeviceTraceScratch work(arena, count, launch, blocks);
    CudaLauncher launcher = plain_launcher(stream, work.launcher);
    launcher.launch("trace.prepare", count,
                    PrepareRay{rays.data(), work.prepared, options.invalid_rays});
    RAYDIX_CUDA_TRY(cudaMemsetAsync(work.next, 0, sizeof(*work.next), launcher.stream()));
    mark(0);
    if (tree.empty()) {
        launcher.launch("trace.miss", count, MissAll{hits.data()});
    } else if (count != 0) {
        const ProfilerRange range("trace.warps");
        const WarpJob job{tree.arrays().scene, {work.prepared, hits.data(), count, work.next}};
        launch_warps(launch, job, work.stacks, blocks, stream);
    }
    mark(1);
    if (!tree.empty())
        launcher.launch("trace.rescale", count, RescaleHit{rays.data(), hits.data()});
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

DeviceWarpTree::DeviceWarpTree(const WarpTree& tree, Stream stream)
    : arrays_(std::make_unique<Arrays>()) {
    static_cast<void>(device_name());  // says what is missing
    check_stack_depth(tree.max_depth());
    arrays_->max_depth = tree.max_depth();
    if (tree.empty()) return;
    const WarpTree::Arrays& from = tree.arrays();
    arrays_->own_ids.upload({from.ids.data(), from.ids.size()}, stream);
    arrays_->scene = {
        upload(arrays_->own_pairs, from.pairs.data(), from.pairs.size(), stream),
        upload(arrays_->own_triangles, from.triangles.data(), from.triangles.size(), stream),
        arrays_->own_ids.data()};
    find_resident_blocks(*arrays_);
}

DeviceWarpTree::DeviceWarpTree(const DeviceTree& tree, Stream stream)
    : arrays_(std::make_unique<Arrays>()) {
    static_cast<void>(device_name());
    if (tree.pairs == nullptr || tree.pair_ids == nullptr)
        throw InputError("the tree on the device was built without node pairs");
    if (tree.triangles == nullptr) throw InputError("the tree on the device is not of triangles");
    DeviceCounts counts{};
    detail::copy_to_host(&counts, tree.counts, sizeof(counts), stream);
    synchronize(stream);
    check_counts(counts, PrimitiveKind::triangles, false);
    check_stack_depth(counts.max_depth);
    arrays_->max_depth = counts.max_depth;
    const std::uint32_t n = counts.references;
    if (n == 0) return;
    arrays_->own_triangles.reset(n * sizeof(WoopTriangle));
    auto* maps = reinterpret_cast<WoopTriangle*>(arrays_->own_triangles.data());
    plain_launcher(stream, nullptr)
        .launch("layout.woop", n, EmitWoopTriangle{tree.triangles, maps});
    arrays_->scene = {tree.pairs, maps, tree.pair_ids};
    find_resident_blocks(*arrays_);
}

void trace_warps_on_device(const DeviceWarpTree& tree, std::span<const Ray> rays,
                           std::span<TreeHit> hits, const DeviceTraceOptions& options,
                           std::span<std::byte> scratch, Stream stream) {
    trace_launches(tree, rays, hits, options, scratch, stream, [](int) {});
}

DeviceTraceMs time_trace_on_device(const DeviceWarpTree& tree, std::span<const Ray> rays,
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
