// What device code says beyond C++, once for each compiler: nvcc (CUDA), clang with gpuintrin.h
// (SPIR-V for OpenCL, and AMD), and the host, where a warp is one lane. Warp kernels, bottom-up
// passes and counters stand on these words alone, so that what one backend executes in a test is
// the text that all of them run.
//
// A warp is 32 lanes. On a device whose hardware has 64 in step it is one half of them.
#pragma once

#include <bit>
#include <cstdint>

#include "base/hd.h"

#if defined(__CUDACC__)
#include <cuda/atomic>
#elif defined(__HIP__)
#include <gpuintrin.h>
#else
#include <atomic>
#endif

// RAYDIX_DEVICE_COMPILER: the compiler knows device code. RAYDIX_DEVICE_PASS: what it compiles now
// is for the device.
#if defined(__CUDACC__) || defined(__HIP__)
#define RAYDIX_DEVICE_COMPILER 1
#endif
#if defined(__CUDA_ARCH__) || defined(__HIP_DEVICE_COMPILE__)
#define RAYDIX_DEVICE_PASS 1
#endif

namespace raydix::words {

#if defined(RAYDIX_DEVICE_COMPILER)
inline constexpr std::uint32_t warp_width = 32;
#else
inline constexpr std::uint32_t warp_width = 1;
#endif

#if defined(__HIP_DEVICE_COMPILE__)
/// Lanes of the hardware that come before this warp's.
__attribute__((device)) inline std::uint32_t lanes_before() {
#if defined(__AMDGPU__)
    return __gpu_lane_id() & ~(warp_width - 1);
#else
    return 0;  // sub-groups of 32 are asked for
#endif
}
__attribute__((device)) inline std::uint64_t hardware_lanes(std::uint32_t members) {
    return std::uint64_t{members} << lanes_before();
}
#endif

/// This thread's place in its warp.
[[nodiscard]] RAYDIX_HD inline std::uint32_t lane_id() {
#if defined(__CUDA_ARCH__)
    return threadIdx.x % warp_width;
#elif defined(__HIP_DEVICE_COMPILE__)
    return __gpu_lane_id() - lanes_before();
#else
    return 0;
#endif
}

// `members`: the lanes that make this very call, bit k for lane k.

/// Bit k: the vote of member k.
[[nodiscard]] RAYDIX_HD inline std::uint32_t ballot([[maybe_unused]] std::uint32_t members,
                                                    bool vote) {
#if defined(__CUDA_ARCH__)
    return __ballot_sync(members, vote);
#elif defined(__HIP_DEVICE_COMPILE__)
    return static_cast<std::uint32_t>(__gpu_ballot(hardware_lanes(members), vote) >>
                                      lanes_before());
#else
    return vote ? 1 : 0;
#endif
}

/// The value of member `from`, which each member may choose for itself.
template <class T>
[[nodiscard]] RAYDIX_HD inline T shuffle([[maybe_unused]] std::uint32_t members, T value,
                                         [[maybe_unused]] std::uint32_t from) {
    static_assert(sizeof(T) == 4 || sizeof(T) == 8);
#if defined(__CUDA_ARCH__)
    return __shfl_sync(members, value, static_cast<int>(from));
#elif defined(__HIP_DEVICE_COMPILE__)
    if constexpr (sizeof(T) == 8)
        return std::bit_cast<T>(__gpu_shuffle_idx_u64(
            hardware_lanes(members), from, std::bit_cast<std::uint64_t>(value), warp_width));
    else
        return std::bit_cast<T>(__gpu_shuffle_idx_u32(
            hardware_lanes(members), from, std::bit_cast<std::uint32_t>(value), warp_width));
#else
    return value;
#endif
}

/// Members wait for each other and see what each of them wrote before.
RAYDIX_HD inline void meet([[maybe_unused]] std::uint32_t members) {
#if defined(__CUDA_ARCH__)
    __syncwarp(members);
#elif defined(__HIP_DEVICE_COMPILE__)
    __scoped_atomic_thread_fence(__ATOMIC_ACQ_REL, __MEMORY_SCOPE_WVFRNT);
    __gpu_sync_lane(hardware_lanes(members));
#endif
}

/// What this thread wrote before is seen by any thread that sees what it writes after.
RAYDIX_HD inline void fence() {
#if defined(__CUDA_ARCH__)
    __threadfence();
#elif defined(__HIP_DEVICE_COMPILE__)
    __scoped_atomic_thread_fence(__ATOMIC_ACQ_REL, __MEMORY_SCOPE_DEVICE);
#endif
}

/// Returns what lay at `place` and leaves `value`. Acquire-release, for all threads of the device.
RAYDIX_HD inline std::uint32_t exchange(std::uint32_t& place, std::uint32_t value) {
#if defined(__CUDACC__)
    return cuda::atomic_ref<std::uint32_t, cuda::thread_scope_device>(place).exchange(
        value, cuda::memory_order_acq_rel);
#elif defined(__HIP_DEVICE_COMPILE__)
    return __scoped_atomic_exchange_n(&place, value, __ATOMIC_ACQ_REL, __MEMORY_SCOPE_DEVICE);
#elif defined(__HIP__)
    return place + value;  // clang is only asked for the device's half
#else
    return std::atomic_ref<std::uint32_t>(place).exchange(value, std::memory_order_acq_rel);
#endif
}

/// Adds to `place` and returns what lay there. Relaxed: it orders nothing else.
RAYDIX_HD inline std::uint32_t fetch_add(std::uint32_t& place, std::uint32_t value) {
#if defined(__CUDACC__)
    return cuda::atomic_ref<std::uint32_t, cuda::thread_scope_device>(place).fetch_add(
        value, cuda::memory_order_relaxed);
#elif defined(__HIP_DEVICE_COMPILE__)
    return __scoped_atomic_fetch_add(&place, value, __ATOMIC_RELAXED, __MEMORY_SCOPE_DEVICE);
#elif defined(__HIP__)
    return place + value;
#else
    return std::atomic_ref<std::uint32_t>(place).fetch_add(value, std::memory_order_relaxed);
#endif
}

/// Returns the byte that lay at `place`, and leaves `value` there if that was 0; else something
/// that is not 0. Acquire-release, for all threads of the device. A device has no exchange of
/// bytes: bits are set in the byte's word, so the whole word must be the caller's.
RAYDIX_HD inline std::uint8_t exchange_zero(std::uint8_t& place, std::uint8_t value) {
#if defined(RAYDIX_DEVICE_PASS)
    const auto address = reinterpret_cast<std::uintptr_t>(&place);
    auto& word = *reinterpret_cast<std::uint32_t*>(address & ~std::uintptr_t{3});
    const unsigned shift = static_cast<unsigned>(address & 3) * 8;
    const std::uint32_t bits = std::uint32_t{value} << shift;
#if defined(__CUDA_ARCH__)
    const std::uint32_t old =
        cuda::atomic_ref<std::uint32_t, cuda::thread_scope_device>(word).fetch_or(
            bits, cuda::memory_order_acq_rel);
#else
    const std::uint32_t old =
        __scoped_atomic_fetch_or(&word, bits, __ATOMIC_ACQ_REL, __MEMORY_SCOPE_DEVICE);
#endif
    return static_cast<std::uint8_t>(old >> shift);
#elif defined(__CUDACC__)
    return cuda::atomic_ref<std::uint8_t, cuda::thread_scope_system>(place).exchange(
        value, cuda::memory_order_acq_rel);
#elif defined(__HIP__)
    return value;
#else
    return std::atomic_ref<std::uint8_t>(place).exchange(value, std::memory_order_acq_rel);
#endif
}

/// The number of set bits.
[[nodiscard]] RAYDIX_HD inline std::uint32_t count_ones(std::uint32_t bits) {
#if defined(__CUDA_ARCH__)
    return static_cast<std::uint32_t>(__popc(bits));
#else
    return static_cast<std::uint32_t>(std::popcount(bits));
#endif
}
/// The place of the lowest set bit; there must be one.
[[nodiscard]] RAYDIX_HD inline std::uint32_t lowest_bit(std::uint32_t bits) {
#if defined(__CUDA_ARCH__)
    return static_cast<std::uint32_t>(__ffs(static_cast<int>(bits)) - 1);
#else
    return static_cast<std::uint32_t>(std::countr_zero(bits));
#endif
}

}  // namespace raydix::words
