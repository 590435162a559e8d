// Launches of the kernels of compressed wide trees on a CUDA stream.
#include <raydix/device_cwbvh.h>
#include <raydix/error.h>

#include "exec/cuda_event.cuh"
#include "gpu/cuda_backend.h"
#include "gpu/device_cwbvh.h"
#include "trace/cwbvh_kernels.cuh"

namespace raydix {
namespace {

constexpr int block_threads = 128;

/// Nearly all trees are less deep than this; a smaller stack leaves more of the cache to the tree.
constexpr int usual_depth = 24;

struct Launch {
    const DeviceBackend::CwbvhCall& call;
    cudaStream_t stream;
    CudaEvent *before, *behind;  // null, or where the device's time is taken

    /// Puts work on the stream, between the marks. What the host must ask comes before this.
    template <class Put>
    void put(const Put& put_work) const {
        if (before != nullptr) before->record(stream);
        put_work();
        RAYDIX_CUDA_TRY(cudaGetLastError());
        if (behind != nullptr) behind->record(stream);
    }
};

/// Blocks that fill the device, and no more than there are rays for.
template <class Kernel>
unsigned resident_blocks(Kernel kernel, unsigned needed) {
    int device = 0, processors = 0, blocks = 0;
    RAYDIX_CUDA_TRY(cudaGetDevice(&device));
    RAYDIX_CUDA_TRY(cudaDeviceGetAttribute(&processors, cudaDevAttrMultiProcessorCount, device));
    RAYDIX_CUDA_TRY(
        cudaOccupancyMaxActiveBlocksPerMultiprocessor(&blocks, kernel, block_threads, 0));
    const unsigned most = static_cast<unsigned>(processors) * static_cast<unsigned>(blocks);
    return most == 0 ? 1 : needed < most ? needed : most;
}

template <bool any, int stack_entries, class Store>
void launch_with_stack(const Launch& launch, const Store& store) {
    const DeviceBackend::CwbvhCall& call = launch.call;
    const kernels::CwbvhRays<Store> given{
        {call.tree.nodes, call.tree.triangles, call.tree.bounds}, call.rays, call.count, store};
    unsigned blocks = (call.count + block_threads - 1) / block_threads;
    if (call.kernel == CwbvhKernel::persistent_cwbvh) {
        auto* next = reinterpret_cast<std::uint32_t*>(call.scratch.data());
        const auto kernel = kernels::persistent_cwbvh_rays<any, stack_entries, Store>;
        blocks = resident_blocks(kernel, blocks);
        launch.put([&] {
            RAYDIX_CUDA_TRY(cudaMemsetAsync(next, 0, sizeof(*next), launch.stream));
            kernel<<<blocks, block_threads, 0, launch.stream>>>(given, next);
        });
    } else {
        launch.put([&] {
            kernels::cwbvh_rays<any, stack_entries, Store>
                <<<blocks, block_threads, 0, launch.stream>>>(given);
        });
    }
}

/// A tree without nodes: every ray misses.
void store_misses(const Launch& launch, const kernels::StoreOccluded& store) {
    launch.put([&] {
        RAYDIX_CUDA_TRY(cudaMemsetAsync(store.occluded, 0, launch.call.count, launch.stream));
    });
}

__global__ void fill_misses(TreeHit* hits, std::uint32_t count) {
    const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
    if (i < count) hits[i] = TreeHit{};
}

void store_misses(const Launch& launch, const kernels::StoreHit& store) {
    const std::uint32_t count = launch.call.count;
    const unsigned blocks = (count + block_threads - 1) / block_threads;
    launch.put(
        [&] { fill_misses<<<blocks, block_threads, 0, launch.stream>>>(store.hits, count); });
}

template <bool any, class Store>
void launch_rays(const Launch& launch, const Store& store) {
    if (launch.call.count == 0)
        launch.put([] {});
    else if (launch.call.tree.node_count == 0)
        store_misses(launch, store);
    else if (launch.call.tree.max_depth <= usual_depth)
        launch_with_stack<any, usual_depth>(launch, store);
    else
        launch_with_stack<any, device_cwbvh_max_depth>(launch, store);
}

void trace(const DeviceBackend::CwbvhCall& call, CudaEvent* before, CudaEvent* behind) {
    check_cwbvh_launch(call);
    const Launch launch{call, static_cast<cudaStream_t>(call.stream), before, behind};
    if (call.occluded == nullptr)
        launch_rays<false>(launch, kernels::StoreHit{call.hits});
    else
        launch_rays<true>(launch, kernels::StoreOccluded{call.occluded});
}

}  // namespace

void CudaBackend::trace_cwbvh(const CwbvhCall& call) {
    static_cast<void>(name());  // says what is missing
    trace(call, nullptr, nullptr);
}

double CudaBackend::time_cwbvh(const CwbvhCall& call) {
    static_cast<void>(name());
    CudaEvent start, stop;
    trace(call, &start, &stop);
    return stop.ms_since(start);
}

}  // namespace raydix
