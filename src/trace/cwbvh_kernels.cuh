// The kernels of compressed wide trees for CUDA.
#pragma once

#include <cuda_runtime.h>

#include "trace/cwbvh_threads.h"

namespace raydix::kernels {

template <bool any, int stack_entries, class Store>
__global__ void __launch_bounds__(128) cwbvh_rays(const CwbvhRays<Store> given) {
    const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
    if (i < given.count) trace_cwbvh_ray<any, stack_entries>(given, i);
}

template <bool any, int stack_entries, class Store>
__global__ void __launch_bounds__(128)
    persistent_cwbvh_rays(const CwbvhRays<Store> given, std::uint32_t* next) {
    trace_cwbvh_pool<any, stack_entries>(given, next);
}

}  // namespace raydix::kernels
