// What every .hip file begins with: clang's words for kernels, the double functions of <cmath> that
// a device needs, and the loops of exec/host_launcher.h as a thread of a device runs them.
#pragma once

// The words of CUDA that the library's headers are written with.
#define __host__ __attribute__((host))
#define __device__ __attribute__((device))
#define __global__ __attribute__((global))
#define __shared__ __attribute__((shared))
#define __forceinline__ inline __attribute__((always_inline))

#include <string.h>
extern "C" __device__ inline void* memcpy(void* to, const void* from, size_t bytes) noexcept {
    return __builtin_memcpy(to, from, bytes);
}

#include <cmath>
#include <cstring>

#include "base/binary_scale.h"

// clang knows most float functions of <cmath> on a device, because they are constexpr; these not.
namespace std {
__device__ inline double sqrt(double x) { return __builtin_sqrt(x); }
__device__ inline double fabs(double x) { return __builtin_fabs(x); }
__device__ inline double fma(double a, double b, double c) { return __builtin_fma(a, b, c); }
__device__ inline double frexp(double x, int* exponent) {
    return raydix::split_exponent(x, exponent);
}
__device__ inline float frexp(float x, int* exponent) {
    return static_cast<float>(raydix::split_exponent(x, exponent));
}
// That of float is known, but llc 22 does not know how to write it.
__host__ __device__ inline double device_ldexp(double x, int n) {
    return raydix::scale_exponent(x, n);
}
__host__ __device__ inline float device_ldexp(float x, int n) {
    // Exponents that are far from a double's limits.
    const int limited = n > 400 ? 400 : n < -400 ? -400 : n;
    return static_cast<float>(raydix::scale_exponent(x, limited));
}
}  // namespace std
#define ldexp device_ldexp

#include "base/device_words.h"
#include "exec/kernel_arguments.h"
#include "exec/warp.h"

// Groups have up to 128 threads. For AMD clang takes 1,024 where nobody says so, and spills.
#if defined(__AMDGPU__)
#define RAYDIX_GROUP_SIZE __attribute__((amdgpu_flat_work_group_size(1, 128)))
#else
#define RAYDIX_GROUP_SIZE
#endif
#define RAYDIX_KERNEL extern "C" __global__ RAYDIX_GROUP_SIZE void

namespace raydix::entry {

__device__ inline std::uint32_t thread() {
    return __gpu_block_id_x() * __gpu_num_threads_x() + __gpu_thread_id_x();
}

template <class Work>
__device__ void each(const EachArguments<Work>& given) {
    const std::uint32_t i = thread();
    if (i < given.n) given.work(i);
}

/// The count is the device's own; a grid that fills the machine strides over it.
template <class Work>
__device__ void counted(const CountedArguments<Work>& given) {
    const std::uint32_t n = *given.count < given.limit ? *given.count : given.limit;
    const std::uint32_t stride = __gpu_num_blocks_x() * __gpu_num_threads_x();
    // 64 bits: the last step may go past 2^32.
    for (std::uint64_t i = thread(); i < n; i += stride) given.work(static_cast<std::uint32_t>(i));
}

template <class Work>
__device__ void warps(const CountedArguments<Work>& given) {
    const std::uint32_t w = thread() / warp_lanes;
    if (w < warps_for(*given.count)) given.work(DeviceWarp(), w);
}

template <class Work>
__device__ void tiles(const EachArguments<Work>& given) {
    const std::uint32_t t = thread() / warp_lanes;
    if (t < given.n) given.work(DeviceWarp(), t);
}

}  // namespace raydix::entry

#define RAYDIX_EACH(name, ...) \
    RAYDIX_KERNEL each_##name(EachArguments<__VA_ARGS__> given) { entry::each(given); }
#define RAYDIX_COUNTED(name, ...) \
    RAYDIX_KERNEL counted_##name(CountedArguments<__VA_ARGS__> given) { entry::counted(given); }
#define RAYDIX_WARPS(name, ...) \
    RAYDIX_KERNEL warps_##name(CountedArguments<__VA_ARGS__> given) { entry::warps(given); }
#define RAYDIX_TILES(name, ...) \
    RAYDIX_KERNEL tiles_##name(EachArguments<__VA_ARGS__> given) { entry::tiles(given); }
