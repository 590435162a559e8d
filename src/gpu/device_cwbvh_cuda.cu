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
    const DeviceCwbvhTree& tree;
    const Ray* rays;
    std::uint32_t count;
    CwbvhKernel kernel;
    std::span<std::byte> scratch;
    cudaStream_t stream;
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
    const kernels::CwbvhRays<Store> given{
        {launch.tree.nodes, launch.tree.triangles, launch.tree.bounds},
        launch.rays,
        launch.count,
        store};
    const unsigned blocks = (launch.count + block_threads - 1) / block_threads;
    if (launch.kernel == CwbvhKernel::persistent_cwbvh) {
        auto* next = reinterpret_cast<std::uint32_t*>(launch.scratch.data());
        RAYDIX_CUDA_TRY(cudaMemsetAsync(next, 0, sizeof(*next), launch.stream));
        const auto kernel = kernels::persistent_cwbvh_rays<any, stack_entries, Store>;
        kernel<<<resident_blocks(kernel, blocks), block_threads, 0, launch.stream>>>(given, next);
    } else {
        kernels::cwbvh_rays<any, stack_entries, Store>
            <<<blocks, block_threads, 0, launch.stream>>>(given);
    }
    RAYDIX_CUDA_TRY(cudaGetLastError());
}

/// A tree without nodes: every ray misses.
void store_misses(const Launch& launch, const kernels::StoreOccluded& store) {
    RAYDIX_CUDA_TRY(cudaMemsetAsync(store.occluded, 0, launch.count, launch.stream));
}

__global__ void fill_misses(TreeHit* hits, std::uint32_t count) {
    const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
    if (i < count) hits[i] = TreeHit{};
}

void store_misses(const Launch& launch, const kernels::StoreHit& store) {
    const unsigned blocks = (launch.count + block_threads - 1) / block_threads;
    fill_misses<<<blocks, block_threads, 0, launch.stream>>>(store.hits, launch.count);
    RAYDIX_CUDA_TRY(cudaGetLastError());
}

template <bool any, class Store>
void launch_rays(const Launch& launch, const Store& store) {
    static_cast<void>(cuda_backend().name());  // says what is missing
    check_cwbvh_launch(launch.tree, launch.count, launch.kernel, launch.scratch);
    if (launch.count == 0) return;
    if (launch.tree.node_count == 0)
        store_misses(launch, store);
    else if (launch.tree.max_depth <= usual_depth)
        launch_with_stack<any, usual_depth>(launch, store);
    else
        launch_with_stack<any, device_cwbvh_max_depth>(launch, store);
}

}  // namespace

void CudaBackend::trace_cwbvh(const CwbvhCall& call) {
    const Launch launch{call.tree,   call.rays,    call.count,
                        call.kernel, call.scratch, static_cast<cudaStream_t>(call.stream)};
    if (call.occluded == nullptr)
        launch_rays<false>(launch, kernels::StoreHit{call.hits});
    else
        launch_rays<true>(launch, kernels::StoreOccluded{call.occluded});
}

double CudaBackend::time_cwbvh(const CwbvhCall& call) {
    static_cast<void>(name());
    CudaEvent start, stop;
    start.record(call.stream);
    trace_cwbvh(call);
    stop.record(call.stream);
    return stop.ms_since(start);
}

}  // namespace raydix
