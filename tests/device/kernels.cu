// Compiling this file shows that the core's per-element functions are device code.
#include "device/kernels.cuh"

#define RAYDIX_DEFINE_KERNEL(name, ...)                                \
    __global__ void name(__VA_ARGS__ work, std::uint32_t n) {          \
        const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x; \
        if (i < n) work(i);                                            \
    }
RAYDIX_DEVICE_KERNELS(RAYDIX_DEFINE_KERNEL)
