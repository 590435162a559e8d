// The __global__ functions: one per kernel, kind of hit and size of stack.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "exec/cuda_error.cuh"
#include "simt/thread_warp.h"
#include "trace/warp/launch_warps.h"
#include "trace/warp/run_warp.h"

namespace raydix {
namespace kernels {

inline constexpr std::uint32_t warps_per_block = warp_block_threads / words::warp_width;

/// Blocks of packets that a multiprocessor must be able to hold: a bound on their registers. Left
/// alone the compiler of CUDA 13.0 stops at 40, which costs a turn of persistent packets three
/// instructions more.
inline constexpr std::uint32_t packet_blocks = 10;
/// Of wide nodes: 64 registers. Left alone the compiler stops at 56, and spills one.
inline constexpr std::uint32_t wide_blocks = 8;

/// Shared memory is dynamic: stacks of packets [warps][stack_entries], or SpareRays [warps].
extern __shared__ std::uint64_t shared_words[];

/// The stack is the thread's own: local memory, which the hardware interleaves by lane.
template <class Kernel, bool any_hit, std::uint32_t stack_entries>
__global__ void __launch_bounds__(warp_block_threads) trace_rays(const WarpJob job) {
    std::int32_t stack[stack_entries];
    ThreadWarp<Lane> warp;
    warp.lane.stack = stack;
    run_warp<Kernel, any_hit>(warp, job,
                              (blockIdx.x * blockDim.x + threadIdx.x) / words::warp_width);
}

/// Groups of children take two entries each.
template <class Kernel, bool any_hit>
__global__ void __launch_bounds__(warp_block_threads, wide_blocks) trace_wide(const WarpJob job) {
    std::int32_t stack[large_stack_entries];
    ThreadWarp<WideLane> warp;
    warp.lane.stack = stack;
    run_warp<Kernel, any_hit>(warp, job,
                              (blockIdx.x * blockDim.x + threadIdx.x) / words::warp_width);
}

/// What is kept of a stack is in registers.
template <class Kernel, bool any_hit>
__global__ void __launch_bounds__(warp_block_threads) trace_short_stack(const WarpJob job) {
    ThreadWarp<typename LaneOf<Kernel>::Type> warp;
    run_warp<Kernel, any_hit>(warp, job,
                              (blockIdx.x * blockDim.x + threadIdx.x) / words::warp_width);
}

/// One stack a warp.
template <class Kernel, bool any_hit>
__global__ void __launch_bounds__(warp_block_threads, packet_blocks)
    trace_packets(const WarpJob job, std::uint32_t stack_entries) {
    ThreadWarp<Lane> warp;
    const std::uint32_t warp_in_block = threadIdx.x / words::warp_width;
    warp.memory.packet_stack =
        reinterpret_cast<std::int32_t*>(shared_words) + warp_in_block * stack_entries;
    run_warp<Kernel, any_hit>(warp, job,
                              (blockIdx.x * blockDim.x + threadIdx.x) / words::warp_width);
}

/// Twice as many rays as lanes, each with a stack of its own wherever it goes.
template <class Kernel, bool any_hit>
__global__ void __launch_bounds__(warp_block_threads)
    trace_queues(const WarpJob job, std::uint32_t stack_entries, std::int32_t* stacks) {
    ThreadWarp<Lane> warp;
    lend_spares(warp, reinterpret_cast<SpareRays*>(shared_words)[threadIdx.x / words::warp_width],
                stacks, std::size_t{blockIdx.x} * blockDim.x + threadIdx.x, stack_entries);
    run_warp<Kernel, any_hit>(warp, job,
                              (blockIdx.x * blockDim.x + threadIdx.x) / words::warp_width);
}

}  // namespace kernels

/// visit(kernel function, bytes of shared memory, arguments behind the job...)
template <bool any_hit, class Visit>
void with_global_function(const WarpLaunch& launch, std::int32_t* stacks, const Visit& visit) {
    with_kernel(launch.kernel, [&]<class Kernel>() {
        using kernels::warps_per_block;
        if constexpr (Kernel::one_stack) {
            const std::size_t bytes = warps_per_block * launch.stack_entries * sizeof(std::int32_t);
            visit(kernels::trace_packets<Kernel, any_hit>, bytes, launch.stack_entries);
        } else if constexpr (Kernel::rays_per_lane == 2) {
            visit(kernels::trace_queues<Kernel, any_hit>, warps_per_block * sizeof(SpareRays),
                  launch.stack_entries, stacks);
        } else if constexpr (std::is_same_v<typename LaneOf<Kernel>::Type, WideLane>) {
            visit(kernels::trace_wide<Kernel, any_hit>, std::size_t{0});
        } else if constexpr (stack_in_registers<Kernel>) {
            visit(kernels::trace_short_stack<Kernel, any_hit>, std::size_t{0});
        } else if (launch.stack_entries <= small_stack_entries) {
            visit(kernels::trace_rays<Kernel, any_hit, small_stack_entries>, std::size_t{0});
        } else {
            visit(kernels::trace_rays<Kernel, any_hit, large_stack_entries>, std::size_t{0});
        }
    });
}

template <bool any_hit>
std::uint32_t resident_blocks_of(const WarpLaunch& launch) {
    int device = 0, multiprocessors = 0, blocks = 0;
    RAYDIX_CUDA_TRY(cudaGetDevice(&device));
    RAYDIX_CUDA_TRY(
        cudaDeviceGetAttribute(&multiprocessors, cudaDevAttrMultiProcessorCount, device));
    with_global_function<any_hit>(launch, nullptr,
                                  [&](auto function, std::size_t shared_bytes, auto...) {
                                      RAYDIX_CUDA_TRY(cudaOccupancyMaxActiveBlocksPerMultiprocessor(
                                          &blocks, function, warp_block_threads, shared_bytes));
                                  });
    return static_cast<std::uint32_t>(std::max(1, blocks) * multiprocessors);
}

template <bool any_hit>
void launch_warps_of(const WarpLaunch& launch, const WarpJob& job, std::int32_t* stacks,
                     std::uint32_t blocks, void* stream) {
    with_global_function<
        any_hit>(launch, stacks, [&](auto function, std::size_t shared_bytes, auto... arguments) {
        function<<<blocks, warp_block_threads, shared_bytes, static_cast<cudaStream_t>(stream)>>>(
            job, arguments...);
        RAYDIX_CUDA_TRY(cudaGetLastError());
    });
}

}  // namespace raydix
